"""Fixed sine/cosine positions, added to the tokens of a sequence (systems.md B2, E4, E5)."""

import torch
from torch import Tensor

from playground.nn.rope import rope_angles


def sinusoid(positions: Tensor | int, width: int) -> Tensor:
    """Positions [..., T] (may be fractions), or their number, -> float32 [..., T, width].

    Sines stand in even columns, cosines in odd ones; base 10000. The width is even.
    """
    places = torch.arange(positions) if isinstance(positions, int) else positions
    cos, sin = rope_angles(places, width, 10_000.0)
    return torch.stack([sin, cos], dim=-1).flatten(-2)
