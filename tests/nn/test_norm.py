import pytest
import torch

from playground.nn.norm import build_norm


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_rms_norm_is_the_formula_and_so_is_its_gradient(dtype):
    torch.manual_seed(0)
    layer = build_norm("rms", 6)
    torch.nn.init.normal_(layer.weight)
    x = torch.randn(4, 3, 6).to(dtype).requires_grad_()
    exact = x.detach().double().requires_grad_()
    expected = exact / (exact.pow(2).mean(dim=-1, keepdim=True) + 1e-5).sqrt() * layer.weight.detach().double()
    out, direction = layer(x), torch.randn(4, 3, 6).to(dtype)
    assert out.dtype == dtype
    near = {"atol": 1e-5, "rtol": 1e-5} if dtype == torch.float32 else {"atol": 0.05, "rtol": 0.05}
    torch.testing.assert_close(out.double(), expected, **near)
    out.backward(direction.to(out.dtype))
    expected.backward(direction.double())
    torch.testing.assert_close(x.grad.double(), exact.grad, **near)


def test_rms_norm_in_half_precision_is_finite_at_zero():
    x = torch.zeros(2, 8, dtype=torch.bfloat16, requires_grad=True)
    out = build_norm("rms", 8)(x)
    out.sum().backward()
    assert not out.any() and x.grad.isfinite().all()


def test_layer_norm_and_unknown_names():
    assert isinstance(build_norm("layer", 4), torch.nn.LayerNorm)
    with pytest.raises(ValueError, match="unknown norm 'batch'; accepted: rms, layer"):
        build_norm("batch", 4)
