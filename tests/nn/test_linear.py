import copy

import pytest
import torch

from playground.nn.linear import Conv3, Linear, linear, pack


@pytest.mark.parametrize("shape", [(2, 5), (1, 5), (3, 7, 5), (5,), (0, 5), (2, 3, 4, 5)])
@pytest.mark.parametrize("bias", [True, False])
def test_values_and_gradients_equal_a_float64_product(shape, bias):
    torch.manual_seed(0)
    layer, x = Linear(5, 9, bias=bias), torch.randn(*shape, requires_grad=True)
    out = layer(x)
    expected = x.double() @ layer.weight.double().T + (layer.bias.double() if bias else 0.0)
    torch.testing.assert_close(out.double(), expected, atol=1e-5, rtol=1e-5)
    weights = torch.randn_like(out)
    ours = torch.autograd.grad((out * weights).sum(), [x, layer.weight])
    slow = torch.autograd.grad((expected * weights.double()).sum(), [x, layer.weight])
    for given, wanted in zip(ours, slow, strict=True):
        torch.testing.assert_close(given, wanted, atol=1e-5, rtol=1e-5)
    with torch.no_grad():
        torch.testing.assert_close(layer(x).double(), expected, atol=1e-5, rtol=1e-5)


def test_strided_and_expanded_inputs():
    torch.manual_seed(0)
    layer, x = Linear(6, 4), torch.randn(6, 10, requires_grad=True)
    layer(x.t()).sum().backward()
    torch.testing.assert_close(x.grad, layer.weight.sum(0)[:, None].expand(6, 10))
    layer(torch.randn(8, 6, requires_grad=True).expand(3, 8, 6)).sum().backward()
    with torch.no_grad():
        row = torch.randn(2, 6)
        torch.testing.assert_close(layer(row[None].expand(3, 2, 6))[2], layer(row))


def test_other_types_take_the_plain_road():
    weight, x = torch.randn(4, 6), torch.randn(3, 6)
    assert linear(x.bfloat16(), weight.bfloat16()).dtype == torch.bfloat16
    torch.testing.assert_close(linear(x.double(), weight.double()), x.double() @ weight.double().T)
    with torch.autocast("cpu", torch.bfloat16):
        assert linear(x, weight).dtype == torch.bfloat16


@pytest.mark.parametrize("relu", [False, True])
@pytest.mark.parametrize("rows", [1, 2, 9])
def test_packed_layers_equal_plain_ones(relu, rows):
    torch.manual_seed(0)
    layer, conv = Linear(6, 4).requires_grad_(False), Conv3(6, 4).requires_grad_(False)
    x = torch.randn(3, rows, 6)
    plain = layer(x), conv(x, relu=relu)
    slow = torch.nn.functional.conv1d(x.transpose(1, 2).double(), conv.weight.double(), conv.bias.double(), padding=1)
    slow = slow.transpose(1, 2).clamp(min=0) if relu else slow.transpose(1, 2)
    torch.testing.assert_close(plain[1].double(), slow, atol=1e-5, rtol=1e-5)
    pack(torch.nn.ModuleList([layer, conv]))
    torch.testing.assert_close(layer(x), plain[0], atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(conv(x, relu=relu), plain[1], atol=1e-5, rtol=1e-5)
    assert conv(x[:, ::2], relu=relu).shape == (3, (rows + 1) // 2, 4)
    assert sorted(conv.state_dict()) == ["bias", "weight"]


def test_only_a_frozen_model_is_packed():
    with pytest.raises(ValueError, match="frozen"):
        pack(Linear(2, 2))


@pytest.mark.parametrize("layer", [Linear(6, 5), Conv3(6, 5)], ids=["linear", "conv"])
def test_a_packed_layer_can_be_copied(layer):
    layer = layer.requires_grad_(False)
    x = torch.randn(2, 7, 6)
    plain = layer(x)
    pack(layer)
    twin = copy.deepcopy(layer)
    assert twin.packed is None and torch.equal(twin.weight, layer.weight) and twin.weight is not layer.weight
    torch.testing.assert_close(twin(x), plain, atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(layer(x), plain, atol=1e-6, rtol=1e-5)
    pack(twin)
    torch.testing.assert_close(twin(x), plain, atol=1e-6, rtol=1e-5)
