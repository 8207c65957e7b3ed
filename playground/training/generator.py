"""Training a generator on the tokens of a frozen tokenizer (systems.md A10, B2, B3, C2, D3, E4)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from playground.checkpoints import Card, save_checkpoint
from playground.data.batches import BatchSource
from playground.generators.base import TokenBatch, TokenNetwork
from playground.nn.transfer import on_device
from playground.text.encoders import TextEncoder, identify
from playground.text.store import FeatureStore
from playground.tokenizers.base import Tokenizer
from playground.tokenizers.quantizers import MultiScaleQuantizer
from playground.training.configs import GeneratorTraining


@dataclass(frozen=True, eq=False)
class TokenBank:
    """Tokens of many windows of many clips, drawn once from the frozen tokenizer.

    ids: int16 [n, sum of scales], every scale filled up to full length with 0; counts: int64 [n, N] real tokens of
    every scale; lengths: int64 [n] frames; captions: the text that guided each one; weights: [n].
    """

    ids: NDArray[np.int16]
    counts: NDArray[np.int64]
    lengths: NDArray[np.int64]
    captions: list[str]
    weights: NDArray[np.float64]


def build_bank(
    tokenizer: Tokenizer,
    source: BatchSource,
    texts: FeatureStore,
    variants: int,
    device: torch.device,
    progress: Callable[[int, int], None] | None = None,
) -> TokenBank:
    """Tokenize `variants` windows of every sample (window, mirror and caption drawn anew) in evaluation mode."""
    chosen = np.repeat(np.arange(len(source.samples)), variants)
    cuts = source.draw(chosen, np.random.default_rng([source.seed, 2]))
    cuts = cuts.take(np.argsort(cuts.rows, kind="stable"))
    rows: list[NDArray[np.int16]] = []
    captions: list[str] = []
    for start in range(0, len(cuts), source.config.size):
        batch = source.fill(cuts.take(slice(start, start + source.config.size)))
        text = texts.lookup(batch.captions).to(device)
        tokens = tokenizer.encode(batch.features.to(device), batch.lengths.to(device), text).tokens
        full = [F.pad(i, (0, s - i.shape[1])) for i, s in zip(tokens.ids, tokenizer.config.scales, strict=True)]
        rows.append(torch.cat(full, dim=1).cpu().numpy().astype(np.int16))
        captions.extend(batch.captions)
        if progress:
            progress(len(captions), len(cuts))
    weights = source.weights[cuts.sample]
    sizes = {int(frames): tokenizer.sizes(int(frames)) for frames in np.unique(cuts.rows)}
    counts = np.array([sizes[int(frames)] for frames in cuts.rows], np.int64)
    return TokenBank(np.concatenate(rows), counts, cuts.rows, captions, weights / weights.sum())


class GeneratorInputs:
    """One training batch on the device. Not a dataclass: Fabric would round its numbers to half precision."""

    def __init__(self, batch: TokenBatch, rng: torch.Generator) -> None:
        self.batch = batch
        self.rng = rng  # what the network draws from


class GeneratorStep(nn.Module):
    """One training pass, loss included: what Fabric wraps."""

    def __init__(self, transformer: TokenNetwork, quantizer: MultiScaleQuantizer) -> None:
        super().__init__()
        self.transformer = transformer
        self._quantizer = [quantizer]  # in a list: frozen, not a part of what is trained

    def forward(self, inputs: GeneratorInputs) -> tuple[Tensor, Tensor]:
        """A batch -> loss, share of right arg-maxes; scalars."""
        return self.transformer.training_loss(inputs.batch, self._quantizer[0], inputs.rng)


class GeneratorTask:
    """One generator run on a token bank."""

    def __init__(
        self,
        transformer: TokenNetwork,
        quantizer: MultiScaleQuantizer,
        config: GeneratorTraining,
        bank: TokenBank,
        held_out: TokenBank | None,
        texts: FeatureStore,
        encoder: TextEncoder,
        data: str,
        tokenizer_hash: str,
        device: torch.device,
    ) -> None:
        self.transformer = transformer
        self.quantizer = quantizer
        self.model = GeneratorStep(transformer, quantizer)
        self.config = config
        self.bank = bank
        self.held_out = held_out
        self.texts = texts.to(device)
        self.encoder = encoder
        self.data = data
        self.tokenizer_hash = tokenizer_hash
        self.device = device

    def _levels(self, values: NDArray[np.generic], counts: NDArray[np.int64]) -> tuple[Tensor, ...]:
        """[B, sum of scales] on the device, one tensor a level, as long as the longest of its counts [B, N]."""
        whole = on_device(values, self.device).split(self.quantizer.scales, dim=1)
        return tuple(level[:, :longest] for level, longest in zip(whole, counts.max(axis=0).tolist(), strict=True))

    def _batch(self, bank: TokenBank, rows: NDArray[np.int64]) -> TokenBatch:
        counts = bank.counts[rows]
        ids = self._levels(bank.ids[rows].astype(np.int64), counts)
        levels = zip(self.quantizer.scales, counts.T, strict=True)
        masks = self._levels(np.concatenate([np.arange(s) < n[:, None] for s, n in levels], axis=1), counts)
        text = self.texts.lookup([bank.captions[row] for row in rows])
        dropped = torch.zeros(len(rows), dtype=torch.bool, device=self.device)
        return TokenBatch(ids, masks, on_device(bank.lengths[rows], self.device), text, dropped)

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the batch of `step`; draw, caption drop and token noise are functions of (seed, step)."""
        c = self.config
        rng = np.random.default_rng([c.seed, 3, step])
        rows = rng.choice(len(self.bank.weights), size=c.size, p=self.bank.weights)
        dropped = rng.random(c.size) < c.caption_drop
        codes = np.repeat(self.quantizer.codes, self.quantizer.scales)
        keep = rng.random((c.size, len(codes))) < c.keep
        other = rng.integers(0, codes, (c.size, len(codes)))
        mine, counts = slice(rank, None, world), self.bank.counts[rows[rank::world]]
        batch = self._batch(self.bank, rows[mine])
        mixed = (batch.ids, self._levels(keep[mine].copy(), counts), self._levels(other[mine].copy(), counts))
        batch = replace(
            batch,
            dropped=on_device(dropped[mine].copy(), self.device),
            noisy=tuple(torch.where(kept, ids, random) for ids, kept, random in zip(*mixed, strict=True)),
        )
        own = torch.Generator().manual_seed(int(rng.integers(2**62)) + rank)
        loss, right = model(GeneratorInputs(batch, own))
        return loss, {"right": right}

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Loss and share of right arg-maxes on the validation split, clean inputs, true captions."""
        if self.held_out is None:
            return {}
        losses, rights, counts = [], [], []
        for start in range(0, len(self.held_out.lengths), self.config.size):
            rows = np.arange(start, min(start + self.config.size, len(self.held_out.lengths)))
            rng = torch.Generator().manual_seed(start)  # the same draws at every validation
            loss, right = self.model(GeneratorInputs(self._batch(self.held_out, rows), rng))
            losses.append(float(loss))
            rights.append(float(right))
            counts.append(len(rows))
        return {
            "val_loss": float(np.average(losses, weights=counts)),
            "val_right": float(np.average(rights, weights=counts)),
        }

    def export(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the shipped form of the generator; it names the tokenizer whose tokens it draws."""
        facts = facts | {"seed": self.config.seed, "tokenizer": self.tokenizer_hash}
        card = Card("generator", self.transformer.config, identify(self.encoder), self.data, facts)
        save_checkpoint(path, cast(nn.Module, self.transformer), card)
