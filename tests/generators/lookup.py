"""A tokenizer that only looks codes up, four frames a token, and random texts: what causal generators are tested on."""

import torch

from playground.text.encoders import TextFeatures
from playground.tokenizers.quantizers import MultiScaleQuantizer


class Lookup:
    """`levels` levels of one length; the embedding is the sum of the code vectors, 0 beyond a row's own tokens."""

    def __init__(self, levels: int = 1, codes: int = 10, length: int = 12, width: int = 6):
        rng = torch.Generator().manual_seed(5)
        self.quantizer = MultiScaleQuantizer((length,) * levels, (codes,) * levels, width, phi="identity")
        for book in self.quantizer.codebooks:
            book.vectors.copy_(torch.randn(codes, width, generator=rng))

    def sizes(self, frames: int) -> tuple[int, ...]:
        return (-(-frames // 4),) * len(self.quantizer.scales)

    def embed(self, tokens, levels=None, lengths=None):
        vectors = [book.vectors[ids] for book, ids in zip(self.quantizer.codebooks, tokens.ids, strict=True)]
        total = torch.stack(vectors[:levels]).sum(0)
        if lengths is None:
            return total
        return total * (torch.arange(total.shape[1]) < -(-lengths[:, None] // 4))[..., None]


def row_of(text: TextFeatures, row: int, words: int | None = None) -> TextFeatures:
    """One row of a batch of texts, its padding cut to `words` positions."""
    part = slice(row, row + 1)
    return TextFeatures(text.tokens[part, :words], text.mask[part, :words], text.pooled[part], text.words[part])


def louder(network: torch.nn.Module, factor: float = 8.0) -> torch.nn.Module:
    """The network in evaluation mode with larger weights, so that inputs matter."""
    for parameter in network.parameters():
        if parameter.ndim > 1:
            parameter.data.mul_(factor)
    return network.eval().requires_grad_(False)
