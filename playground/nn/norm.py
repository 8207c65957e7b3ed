"""Normalisation layers by name."""

from torch import nn

NORMS = ("rms", "layer")


def build_norm(kind: str, width: int) -> nn.Module:
    """`rms` (RMSNorm, eps 1e-5, learned scale; A3) or `layer` (LayerNorm; Table 4a-c). ValueError for another name."""
    if kind == "rms":
        return nn.RMSNorm(width, eps=1e-5)
    if kind == "layer":
        return nn.LayerNorm(width, eps=1e-5)
    raise ValueError(f"unknown norm {kind!r}; accepted: {', '.join(NORMS)}")
