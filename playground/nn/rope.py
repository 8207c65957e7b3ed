"""Rotary position embedding on interleaved pairs (2i, 2i+1): angle = position * base^(-2i / head width) (A3, A9)."""

import torch
from torch import Tensor

Rotation = tuple[Tensor, Tensor]  # cos, sin, each [..., T, head width / 2]


def rope_angles(positions: Tensor, head_width: int, base: float) -> Rotation:
    """positions [..., T] (may be fractions) -> cos and sin [..., T, head_width / 2], float32."""
    exponent = torch.arange(0, head_width, 2, device=positions.device, dtype=torch.float32) / head_width
    angle = positions.float()[..., None] * base**-exponent
    return angle.cos(), angle.sin()


def apply_rope(x: Tensor, rotation: Rotation) -> Tensor:
    """Rotate x [B, H, T, head width] by angles [T, head width / 2] or [B, 1, T, head width / 2]."""
    pairs = torch.view_as_complex(x.float().unflatten(-1, (-1, 2)))  # one multiplication instead of four
    return torch.view_as_real(pairs * torch.complex(*rotation)).flatten(-2).to(x.dtype)
