import numpy as np
import pytest
import torch
from torch import nn

from playground.nn.convolutions import (
    AttentionBlock,
    ConvDecoder,
    ConvEncoder,
    DilatedBlock,
    NormedBlock,
    Stack,
    Stage,
)


def array(x: torch.Tensor) -> np.ndarray:
    return x.detach().double().numpy()


def slow_conv(x: np.ndarray, layer: nn.Conv1d) -> np.ndarray:
    """Convolution of [D, T] by its definition, zeros beyond the ends."""
    weight, bias = array(layer.weight), array(layer.bias)
    kernel, (step,), (pad,), (gap,) = weight.shape[2], layer.stride, layer.padding, layer.dilation
    count = (x.shape[1] + 2 * pad - gap * (kernel - 1) - 1) // step + 1
    out = np.repeat(bias[:, None], count, axis=1)
    for t in range(count):
        for k in range(kernel):
            at = t * step - pad + k * gap
            if 0 <= at < x.shape[1]:
                out[:, t] += weight[:, :, k] @ x[:, at]
    return out


def slow_group_norm(x: np.ndarray, layer: nn.GroupNorm) -> np.ndarray:
    out = x.copy()
    for rows in np.split(np.arange(len(x)), layer.num_groups):
        out[rows] = (x[rows] - x[rows].mean()) / np.sqrt(x[rows].var() + layer.eps)
    return out * array(layer.weight)[:, None] + array(layer.bias)[:, None]


def silu(x: np.ndarray) -> np.ndarray:
    return x / (1 + np.exp(-x))


def relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0)


def slow_dilated(x: np.ndarray, block: DilatedBlock) -> np.ndarray:
    return x + slow_conv(relu(slow_conv(relu(x), block.wide)), block.narrow)


@pytest.mark.parametrize("dilation", [1, 3, 9])
def test_dilated_block_equals_the_formula(dilation):
    block, x = DilatedBlock(4, dilation, 0.0), torch.randn(1, 4, 11)
    np.testing.assert_allclose(array(block(x, None))[0], slow_dilated(array(x)[0], block), atol=1e-5)


def test_normed_block_equals_the_formula():
    block, x = NormedBlock(4, 8, 0.0), torch.randn(1, 4, 7)
    for norm in block.norms:
        nn.init.normal_(norm.weight)
        nn.init.normal_(norm.bias)
    y = array(x)[0]
    out = slow_conv(silu(slow_group_norm(y, block.norms[0])), block.convs[0])
    out = slow_conv(silu(slow_group_norm(out, block.norms[1])), block.convs[1])
    np.testing.assert_allclose(array(block(x, None))[0], slow_conv(y, block.shortcut) + out, atol=1e-5)
    with pytest.raises(ValueError, match="one length"):
        block(x, torch.ones(1, 1, 7, dtype=torch.bool))


def test_attention_block_sees_every_real_step_and_no_other():
    block = AttentionBlock(8, 2, 0.0).eval()
    x, mask = torch.randn(1, 8, 6), torch.tensor([[[True] * 4 + [False] * 2]])
    out = block(x * mask, mask)
    torch.testing.assert_close(out[..., :4], block(x[..., :4], None), atol=1e-6, rtol=1e-5)
    assert not out[..., 4:].any()
    moved = x.clone()
    moved[..., 3] += torch.randn(1, 8)  # another step, which the norm does not take away again
    assert ((block(moved * mask, mask) - out)[..., :4].abs().amax(1) > 0).all()


def plain(stages: list[Stage], **changes) -> tuple[ConvEncoder, ConvDecoder]:
    stack = Stack(**({"kind": "dilated", "blocks": 2, "heads": 2, "dropout": 0.0, "attention_dropout": 0.0}
                     | {"middle": False, "middle_attention": False} | changes))  # fmt: skip
    return ConvEncoder(5, 3, stages, stack), ConvDecoder(3, 5, stages, stack)


def test_momasks_stacks_are_what_the_paper_lists():
    """B1: convolution, ReLU, [halve, residual blocks], convolution; and back with nearest doubling."""
    encoder, decoder = plain([Stage(4, 4, True, False)])
    x, z = torch.randn(1, 5, 12), torch.randn(1, 3, 6)
    y = relu(slow_conv(array(x)[0], encoder.stem))
    y = slow_conv(y, encoder.steps[0])
    for block, dilation in zip(encoder.stages[0].blocks, (3, 1), strict=True):
        assert block.wide.dilation == (dilation,)
        y = slow_dilated(y, block)
    np.testing.assert_allclose(array(encoder(x, [None, None]))[0], slow_conv(y, encoder.head), atol=1e-5)
    y = relu(slow_conv(array(z)[0], decoder.stem))
    for block in decoder.stages[0].blocks:
        y = slow_dilated(y, block)
    y = slow_conv(np.repeat(y, 2, axis=1), decoder.steps[0])
    y = slow_conv(relu(slow_conv(y, decoder.last)), decoder.head)
    np.testing.assert_allclose(array(decoder(z, [None, None]))[0], y, atol=1e-5)


@pytest.mark.parametrize("kind", ["dilated", "normed"])
@pytest.mark.parametrize("halve", [(False, True, True), (False, False, False)])
def test_shapes_follow_the_stages(kind, halve):
    widths = (8, 8, 16, 8)
    stages = [Stage(widths[n], widths[n + 1], halve[n], n == 2) for n in range(3)]
    encoder, decoder = plain(stages, kind=kind, middle=True, middle_attention=True)
    z = encoder(torch.randn(2, 5, 16), [None] * 4)
    assert z.shape == (2, 3, 16 // 2 ** sum(halve))
    assert decoder(z, [None] * 4).shape == (2, 5, 16)
