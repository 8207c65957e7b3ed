"""Linear layers through oneDNN on the CPU.

torch sends float32 `linear` on the CPU to MKL, which leaves AVX-512 unused on other makers' processors; oneDNN, which
torch carries too, uses it everywhere. Same arithmetic in float32, sums in another order.
"""

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

_onednn = getattr(torch.ops.mkldnn, "_linear_pointwise", None) if torch.backends.mkldnn.is_available() else None


class _Linear(torch.autograd.Function):
    """x [..., K], weight [N, K], bias [N] or None -> [..., N], forward and backward through oneDNN."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor | None) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.bias = bias is not None
        return _product(x, weight, bias)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, Tensor | None, Tensor | None]:
        x, weight = ctx.saved_tensors
        rows = gradient.flatten(0, -2)
        to_x = _product(gradient, weight.t().contiguous(), None) if ctx.needs_input_grad[0] else None
        to_weight = None
        if ctx.needs_input_grad[1]:
            to_weight = _product(rows.t().contiguous(), x.flatten(0, -2).t().contiguous(), None)
        return to_x, to_weight, rows.sum(0) if ctx.bias and ctx.needs_input_grad[2] else None


def _product(x: Tensor, weight: Tensor, bias: Tensor | None) -> Tensor:
    assert _onednn is not None
    out: Tensor = _onednn(x.contiguous(), weight, bias, "none", [], "")
    return out


def linear(x: Tensor, weight: Tensor, bias: Tensor | None = None) -> Tensor:
    """`torch.nn.functional.linear`, through oneDNN where that is faster: float32 on the CPU, at least two rows."""
    plain = x.device.type != "cpu" or x.dtype != torch.float32 or weight.dtype != torch.float32 or x.ndim < 2
    if plain or _onednn is None or torch.is_autocast_enabled("cpu") or x.numel() < 2 * x.shape[-1]:
        return F.linear(x, weight, bias)
    if torch.is_grad_enabled() and (x.requires_grad or weight.requires_grad):
        out: Tensor = _Linear.apply(x, weight, bias)
        return out
    return _product(x, weight, bias)


class Linear(nn.Linear):
    """`nn.Linear` through `linear`; the same parameters, names and initialisation."""

    def forward(self, x: Tensor) -> Tensor:
        """x [..., K] -> [..., N]."""
        return linear(x, self.weight, self.bias)
