"""Convolutions over the frames of patches: against a slow formula, nothing at the start, nothing from padding."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from playground.nn.seams import Seams
from playground.tokenizers.transformer import build_tokenizer
from tests.tiny import TINY


def filled(columns: int = 5, width: int = 7, patch: int = 3) -> Seams:
    """A module with random weights everywhere."""
    seams = Seams(columns, width, patch)
    with torch.no_grad():
        for parameter in seams.parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=torch.Generator().manual_seed(parameter.numel())))
    return seams.eval().requires_grad_(False)


def by_hand(seams: Seams, motion: Tensor) -> Tensor:
    """One motion [F, C], number by number."""
    x = motion.double()
    for number, layer in enumerate(seams.layers):
        out = torch.zeros(len(x), layer.out_channels, dtype=torch.float64)
        for frame in range(len(x)):
            for tap in range(3):
                seen = frame + tap - 1
                if 0 <= seen < len(x):
                    out[frame] += layer.weight[:, :, tap].double() @ x[seen]
            out[frame] += layer.bias.double()
            if number == 0:
                out[frame] += seams.places[frame % len(seams.places)].double()
        last = number == len(seams.layers) - 1
        x = out if last else 0.5 * out * (1 + torch.erf(out / math.sqrt(2)))
    return motion.double() + x


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 10])
def test_the_correction_is_that_of_a_loop(frames):
    seams = filled()
    motion = torch.randn(frames, 5, generator=torch.Generator().manual_seed(frames))
    assert torch.allclose(seams(motion[None], None)[0].double(), by_hand(seams, motion), rtol=1e-4, atol=1e-4)


def test_frames_that_are_not_real_change_nothing():
    seams = filled()
    motion = torch.randn(2, 12, 5, generator=torch.Generator().manual_seed(0))
    real = (torch.arange(12)[None] < torch.tensor([[7], [12]]))[..., None]
    motion[0, 7:] = 1e6
    together = seams(motion, real)
    assert torch.allclose(together[0, :7], seams(motion[:1, :7], None)[0], rtol=1e-4, atol=1e-4)
    assert torch.allclose(together[1], seams(motion[1:], None)[0], rtol=1e-4, atol=1e-4)


def test_untrained_it_adds_nothing_to_a_tokenizer():
    torch.manual_seed(0)
    plain = build_tokenizer(TINY).eval()
    joined = build_tokenizer(replace(TINY, seam=6)).eval()
    missing, unexpected = joined.load_state_dict(plain.state_dict(), strict=False)
    assert not unexpected and all(name.startswith("seams.") for name in missing) and missing
    embedding = torch.randn(2, TINY.scales[-1], TINY.code_width)
    lengths = torch.tensor([TINY.max_frames, TINY.max_frames - 3])
    assert torch.equal(plain.decode(embedding, lengths, None), joined.decode(embedding, lengths, None))
