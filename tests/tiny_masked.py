"""Tiny masked generators made on the spot, and their layers row by row in plain arithmetic."""

import math

import torch

from playground.generators.masked import MaskedConfig, MaskedGenerator, MaskedResidual
from playground.generators.masked_scales import MaskedScales, MaskedScalesConfig, MaskedScalesGenerator
from playground.text.encoders import TextFeatures
from playground.tokenizers.convolutional import ConvConfig, ConvTokenizer, build_conv
from tests.tiny import tiny_tokenizer

SMALL = {"width": 16, "depth": 2, "heads": 2, "hidden": 24, "dropout": 0.0, "text_width": 20, "code_width": 12}
KINDS = ("momask", "momask-lgtok", "momask++", "momask++-cross")


def tiny_conv(divisors: tuple[int, ...], shared: bool) -> ConvTokenizer:
    """A convolutional tokenizer of at most 12 latents with filled codebooks; tokens follow a motion's length."""
    config = ConvConfig(
        max_frames=48, width=8, heads=2, dropout=0.0, divisors=divisors, codes=(9,) * len(divisors), code_width=12,
        shared=shared,
    )  # fmt: skip
    with torch.random.fork_rng():
        torch.manual_seed(1)
        model = build_conv(config).eval().requires_grad_(False)
        for book in model.quantizer.codebooks:
            book.vectors.normal_()
    return model


def strong(network, seed=0):
    """Weights so large that every input matters."""
    rng = torch.Generator().manual_seed(seed)
    for name, parameter in network.named_parameters():
        if parameter.ndim > 1:
            parameter.data.normal_(std=0.5 if "tokens" in name or "tables" in name else 0.3, generator=rng)
    return network.eval().requires_grad_(False)


def tiny(kind: str, seed: int = 0, **changes):
    """A generator of a kind with random weights."""
    if kind == "momask":
        config = MaskedConfig(**(SMALL | {"scales": (12,) * 3, "codes": (9,) * 3, "iterations": 4} | changes))
        return MaskedGenerator(strong(MaskedResidual(config), seed), tiny_conv((1, 1, 1), shared=False))
    if kind == "momask-lgtok":
        config = MaskedConfig(**(SMALL | {"scales": (6,) * 3, "codes": (9,) * 3, "iterations": 4} | changes))
        tokenizer = tiny_tokenizer(scales=(6,) * 3, codes=(9,) * 3, phi="identity", metric="euclidean")
        return MaskedGenerator(strong(MaskedResidual(config), seed), tokenizer)
    variant = "cross" if kind.endswith("cross") else "in-context"
    base = {"scales": (3, 6, 12), "codes": (9,) * 3, "iterations": 6, "variant": variant, "null_words": 3}
    network = MaskedScales(MaskedScalesConfig(**(SMALL | base | changes)))
    return MaskedScalesGenerator(strong(network, seed), tiny_conv((4, 2, 1), shared=True))


def one_text(text: TextFeatures, row: int) -> TextFeatures:
    return TextFeatures(text.tokens[row : row + 1], text.mask[row : row + 1], text.pooled[row : row + 1], [[]])


def slow_attention(x, to, attention, heads):
    """One query vector x [D] to rows `to` [S, D], head by head, with explicit exponentials."""
    width = len(x)
    if hasattr(attention, "qkv"):
        weight, bias = attention.qkv.weight.double(), attention.qkv.bias.double()
        query, (key, value) = (
            weight[:width] @ x + bias[:width],
            ((to @ weight.T + bias)[:, i * width :] for i in (1, 2)),
        )
    else:
        query = attention.query.weight.double() @ x + attention.query.bias.double()
        both = to @ attention.key_value.weight.double().T + attention.key_value.bias.double()
        key, value = both, both[:, width:]
    out = []
    for head in range(heads):
        part = slice(head * width // heads, (head + 1) * width // heads)
        score = [float(query[part] @ k[part]) / math.sqrt(width // heads) for k in key]
        mass = [math.exp(s - max(score)) for s in score]
        out.append(sum(m / sum(mass) * v[part] for m, v in zip(mass, value, strict=True)))
    return attention.out.weight.double() @ torch.cat(out) + attention.out.bias.double()


def slow_layer(rows, block, heads, memory=None):
    """A post-norm encoder (or decoder) layer on rows [S, D], row by row."""

    def norm(x, layer):
        centred = x - x.mean()
        return centred / (centred.square().mean() + 1e-5).sqrt() * layer.weight.double() + layer.bias.double()

    rows = torch.stack([norm(x + slow_attention(x, rows, block.self_attention, heads), block.norms[0]) for x in rows])
    if memory is not None:
        cross = block.cross_attentions[0]
        rows = torch.stack([norm(x + slow_attention(x, memory, cross, heads), block.norms[1]) for x in rows])
    out = []
    for x in rows:
        up = block.feed_forward.up.weight.double() @ x + block.feed_forward.up.bias.double()
        up = torch.tensor([0.5 * v * (1 + math.erf(v / math.sqrt(2))) for v in up.tolist()], dtype=torch.float64)
        down = block.feed_forward.down.weight.double() @ up + block.feed_forward.down.bias.double()
        out.append(norm(x + down, block.norms[-1]))
    return torch.stack(out)


def slow_sinusoid(position, width):
    angle = [position / 10_000 ** (2 * (i // 2) / width) for i in range(width)]
    return torch.tensor([math.cos(a) if i % 2 else math.sin(a) for i, a in enumerate(angle)], dtype=torch.float64)


def slow_trunk(trunk, vectors, positions, prefix, heads=2, memory=None):
    """Real token vectors [S, code width] of one row -> outputs [S, ...]."""
    x = vectors.double() @ trunk.token_proj.weight.double().T + trunk.token_proj.bias.double()
    x = torch.stack([row + slow_sinusoid(p, len(row)) for row, p in zip(x, positions, strict=True)])
    rows = torch.cat([prefix, x]) if prefix is not None else x
    for block in trunk.blocks:
        rows = slow_layer(rows, block, heads, memory)
    return trunk.head.double()(rows[-len(vectors) :])


def text_rows(trunk, states):
    return states.double() @ trunk.text_proj.weight.double().T + trunk.text_proj.bias.double()
