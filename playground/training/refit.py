"""Refit of a detokenizer on imperfect tokens: an extra phase of ours, after tokenizer and generator are trained.

A tokenizer's training shows its detokenizer true tokens only, so drawn tokens, a little inconsistent among the fine
scales, come back with trembling hands and sliding feet. Here the encoder, the quantizer and the text projection stay as
they are, thus every token stays the same; the detokenizer alone learns to give the true motion back from three kinds
of tokens: true ones, ones whose fine scales the generator drew anew, and the coarse scales alone.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from playground.checkpoints import Card, read_card, save_checkpoint
from playground.data.batches import Batch, BatchSource, Cuts
from playground.generators.base import Edit
from playground.generators.scalewise import ScalewiseGenerator, ScalewiseTransformer
from playground.motion.representation import Normaliser
from playground.nn.sampling import Sampling
from playground.nn.transfer import on_device
from playground.text.store import FeatureStore
from playground.tokenizers.base import TrainingOutput
from playground.tokenizers.transformer import LGTok
from playground.training.configs import RefitTraining
from playground.training.feet import foot_loss
from playground.training.tokenizer import jump_loss, reconstruction_errors, tokenizer_loss, velocity_loss

REFIT = ("decoder", "from_code", "motion_out", "query_positions", "seams")  # what is trained


@dataclass(frozen=True, eq=False)
class RefitBank:
    """Windows with their tokens, drawn once. cuts: which windows; true, drawn: ids int16 [n, sum of scales], the second
    with scales `first` [n] (0-based) and finer drawn by the generator."""

    cuts: Cuts
    true: NDArray[np.int16]
    drawn: NDArray[np.int16]
    weights: NDArray[np.float64]


def build_refit_bank(
    generator: ScalewiseGenerator,
    tokenizer: LGTok,
    source: BatchSource,
    texts: FeatureStore,
    config: RefitTraining,
    progress: Callable[[int, int], None] | None = None,
) -> RefitBank:
    """Tokenize `variants` windows of every sample and draw the fine scales of each anew, given its caption."""
    rng = np.random.default_rng([config.seed, 4])
    cuts = source.draw(np.repeat(np.arange(len(source.samples)), config.variants), rng)
    cuts = cuts.take(np.argsort(cuts.rows, kind="stable"))
    levels, size = len(generator.quantizer.scales), source.config.size
    first = rng.integers(config.true_scales, levels, len(cuts))
    true: list[NDArray[np.int16]] = []
    drawn: list[NDArray[np.int16]] = []
    for start in range(0, len(cuts), size):
        batch = source.fill(cuts.take(slice(start, start + size)))
        text = texts.lookup(batch.captions)
        tokens = tokenizer.encode(batch.features, batch.lengths, text).tokens
        from_level = torch.from_numpy(first[start : start + size])[:, None].to(batch.lengths.device)
        redraw = tuple((from_level <= n).expand(-1, s) for n, s in enumerate(generator.quantizer.scales))
        sampling = Sampling(seed=config.seed + start, cfg=config.cfg)
        *_, last = generator.steps(text, batch.lengths, sampling, Edit(tokens, redraw))
        for rows, found in ((true, tokens), (drawn, last.tokens)):
            rows.append(torch.cat(found.ids, dim=1).cpu().numpy().astype(np.int16))
        if progress:
            progress(min(start + size, len(cuts)), len(cuts))
    weights = source.weights[cuts.sample]
    return RefitBank(cuts, np.concatenate(true), np.concatenate(drawn), weights / weights.sum())


class RefitInputs:
    """One training batch on the device. Not a dataclass: Fabric would round its numbers to half precision."""

    def __init__(self, batch: Batch, embedding: Tensor, text: Any, dropped: Tensor) -> None:
        self.batch = batch
        self.embedding = embedding  # [B, T, code width]
        self.text = text
        self.dropped = dropped  # bool [B], no language


class RefitStep(nn.Module):
    """One training pass of the detokenizer, loss included: what Fabric wraps."""

    def __init__(self, model: LGTok, config: RefitTraining, normaliser: Normaliser) -> None:
        super().__init__()
        self.tokenizer = model
        self.config = config
        self.heading_std = float(normaliser.std[0])
        self.mean: Tensor
        self.std: Tensor
        self.register_buffer("mean", torch.from_numpy(normaliser.mean.copy()), persistent=False)
        self.register_buffer("std", torch.from_numpy(normaliser.std.copy()), persistent=False)
        for name, parameter in model.named_parameters():
            parameter.requires_grad_(name.split(".")[0] in REFIT)

    def forward(self, inputs: RefitInputs) -> tuple[Tensor, Tensor]:
        """A batch -> loss and its part for velocities; scalars."""
        batch, c = inputs.batch, self.config
        features = batch.features
        out = self.tokenizer.detokenize(inputs.embedding, batch.lengths, inputs.text, inputs.dropped, features.shape[1])
        result = TrainingOutput(out, out.new_zeros(()), ())
        loss = tokenizer_loss(
            result, features, batch.lengths, c.tokenizer_training, self.heading_std, batch.mean_frames
        )
        moved = velocity_loss(out.float(), features, batch.lengths, batch.mean_frames)
        loss = loss + c.velocity * moved
        if c.smooth:
            loss = loss + c.smooth * jump_loss(out.float(), features, batch.lengths, batch.mean_frames)
        if c.feet:
            rows, real = (x * self.std + self.mean for x in (out.float(), features))
            loss = loss + c.feet * foot_loss(rows, real, batch.lengths, batch.mean_frames)
        return loss, moved.detach()


class RefitTask:
    """One refit run on a bank."""

    def __init__(
        self,
        model: LGTok,
        config: RefitTraining,
        bank: RefitBank,
        batches: BatchSource,
        validation: list[Batch],
        texts: FeatureStore,
        card: Card,
        generator: tuple[ScalewiseTransformer, Card],
        device: torch.device,
    ) -> None:
        self.tokenizer = model
        self.model = RefitStep(model, config, batches.normaliser)
        self.config = config
        self.bank = bank
        self.batches = batches
        self.validation = validation
        self.texts = texts.to(device)
        self.card = card  # of the tokenizer as it was
        self.generator = generator  # whose tokens were drawn
        self.device = device

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the batch of `step`: draw, kinds of tokens and language drop are functions of (seed, step)."""
        c, bank = self.config, self.bank
        rng = np.random.default_rng([c.seed, 5, step])
        rows = rng.choice(len(bank.weights), size=c.batch.size, p=bank.weights)
        kind = rng.random(c.batch.size)
        kept = np.where(kind < c.coarse, rng.integers(c.true_scales, self._levels, c.batch.size), self._levels)
        drop = rng.random(c.batch.size) < c.language_drop
        drawn = (kind >= c.coarse) & (kind < c.coarse + c.redrawn)
        ids = np.where(drawn[:, None], bank.drawn[rows], bank.true[rows])
        frames = float(bank.cuts.rows[rows].sum()) / world
        mine = slice(rank, None, world)
        batch = self.batches.fill(bank.cuts.take(rows[mine]), int(bank.cuts.rows[rows].max()), frames)
        embedding = self._embed(ids[mine], kept[mine])
        text = self.texts.lookup(batch.captions)
        loss, moved = model(RefitInputs(batch, embedding, text, on_device(drop[mine].copy(), self.device)))
        return loss, {"velocity": moved}

    @property
    def _levels(self) -> int:
        return len(self.tokenizer.quantizer.scales)

    @torch.no_grad()
    def _embed(self, ids: NDArray[np.int16], kept: NDArray[np.int64]) -> Tensor:
        """Ids [B, sum of scales] -> embeddings [B, T, code width] of the first `kept` [B] scales of each row."""
        quantizer = self.tokenizer.quantizer
        levels = on_device(ids.astype(np.int64), self.device).split(quantizer.scales, dim=1)
        sums = torch.stack(list(quantizer.accumulate(levels)))
        return sums[on_device(kept - 1, self.device), torch.arange(len(ids), device=self.device)]

    def validate(self) -> dict[str, float]:
        """The tokenizer's own validation figures, from true tokens."""
        return reconstruction_errors(self.tokenizer, self.validation, self.texts, self.batches.normaliser, self.device)

    def export(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the whole tokenizer, what it was with the refitted detokenizer, and in the folder `generator` beside
        its own the generator, which names the new tokenizer: the tokens are the same."""
        refit = {key: facts[key] for key in ("step", "seconds")} | {"from": self.card.hash[:12]}
        refits = [*self.card.facts.get("refit", []), refit]  # one may follow another
        merged = self.card.facts | {"refit": refits, "validation": facts["validation"]}
        save_checkpoint(path, self.tokenizer, replace(self.card, config=self.tokenizer.config, facts=merged))
        network, card = self.generator
        named = card.facts | {"tokenizer": read_card(path).hash[:12]}
        save_checkpoint(path.parents[1] / "generator" / path.name, network, replace(card, facts=named))
