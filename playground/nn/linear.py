"""Linear layers and kernel-3 convolutions through oneDNN on the CPU.

torch sends float32 `linear` on the CPU to MKL, which leaves AVX-512 unused on other makers' processors; oneDNN, which
torch carries too, uses it everywhere. Same arithmetic in float32, sums in another order. `pack` lays the weights of a
frozen model out once, so that calls with few rows do not do it again each time.
"""

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

_onednn = getattr(torch.ops.mkldnn, "_linear_pointwise", None) if torch.backends.mkldnn.is_available() else None
_reorder = getattr(torch.ops.mkldnn, "_reorder_linear_weight", None)


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


def _product(x: Tensor, weight: Tensor, bias: Tensor | None, activation: str = "none") -> Tensor:
    assert _onednn is not None
    out: Tensor = _onednn(x.contiguous(), weight, bias, activation, [], "")
    return out


def _usable(x: Tensor, weight: Tensor) -> bool:
    """Float32 on the CPU, outside of autocast, and at least two rows."""
    plain = x.device.type != "cpu" or x.dtype != torch.float32 or weight.dtype != torch.float32 or x.ndim < 2
    return not (plain or _onednn is None or torch.is_autocast_enabled("cpu") or x.numel() < 2 * x.shape[-1])


def linear(x: Tensor, weight: Tensor, bias: Tensor | None = None) -> Tensor:
    """`torch.nn.functional.linear`, through oneDNN where that is faster."""
    if not _usable(x, weight):
        return F.linear(x, weight, bias)
    if torch.is_grad_enabled() and (x.requires_grad or weight.requires_grad):
        out: Tensor = _Linear.apply(x, weight, bias)
        return out
    return _product(x, weight, bias)


class _Packable:
    """Holds the laid-out weights, which stay behind when the layer is copied: they cannot be, nor moved to a GPU."""

    packed: Tensor | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "packed"}


class Linear(_Packable, nn.Linear):
    """`nn.Linear` through `linear`; the same parameters, names and initialisation."""

    def forward(self, x: Tensor) -> Tensor:
        """x [..., K] -> [..., N]."""
        if self.packed is not None and _usable(x, self.weight):
            return _product(x, self.packed, self.bias)
        return linear(x, self.weight, self.bias)


class Conv3(_Packable, nn.Conv1d):
    """Convolution of kernel 3 and padding 1 along time, on [B, T, K] -> [B, T, N]; the parameters of `nn.Conv1d`."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 3, padding=1)

    def forward(self, x: Tensor, *, relu: bool = False) -> Tensor:
        """x [B, T, K] -> [B, T, N], clipped below at 0 if `relu`."""
        if self.packed is not None and _usable(x, self.weight):
            return _product(_neighbours(x), self.packed, self.bias, "relu" if relu else "none")
        out = super().forward(x.transpose(1, 2)).transpose(1, 2)
        return F.relu(out) if relu else out


def _neighbours(x: Tensor) -> Tensor:
    """[B, T, K] -> [B, T, 3K]: every row with the one before and the one after it, zeros beyond the ends."""
    batch, rows, width = x.shape
    padded = F.pad(x, (0, 0, 1, 1))
    return padded.as_strided((batch, rows, 3 * width), (padded.stride(0), width, 1))


def pack(model: nn.Module) -> None:
    """Lay out the weights of a frozen float32 model on the CPU for inference; results stay the same.

    ValueError if a parameter still takes gradients. Weights changed afterwards are not seen.
    """
    if any(p.requires_grad for p in model.parameters()):
        raise ValueError("only a frozen model can be packed")
    if _onednn is None or _reorder is None:
        return
    for module in model.modules():
        if isinstance(module, Linear):
            module.packed = _reorder(module.weight.detach())
        elif isinstance(module, Conv3):
            module.packed = _reorder(module.weight.detach().permute(0, 2, 1).flatten(1).contiguous())
