"""Training a generator that makes features without tokens: MDM's denoiser (systems.md D4)."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from playground.checkpoints import Card, save_checkpoint
from playground.data.batches import Batch, BatchSource
from playground.generators.base import FeatureBatch, FeatureNetwork
from playground.nn.transfer import on_device
from playground.text.encoders import TextEncoder, identify
from playground.text.store import FeatureStore
from playground.training.configs import FeatureTraining


class FeatureInputs:
    """One training batch on the device. Not a dataclass: Fabric would round its numbers to half precision."""

    def __init__(self, batch: FeatureBatch, rng: torch.Generator) -> None:
        self.batch = batch
        self.rng = rng  # what the network draws from


class FeatureStep(nn.Module):
    """One training pass, loss included: what Fabric wraps."""

    def __init__(self, network: FeatureNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, inputs: FeatureInputs) -> tuple[Tensor, Tensor]:
        """A batch -> loss, mean squared error of the predicted motion; scalars."""
        return self.network.training_loss(inputs.batch, inputs.rng)


class FeatureTask:
    """One run on batches of motions with captions."""

    def __init__(
        self,
        network: FeatureNetwork,
        config: FeatureTraining,
        batches: BatchSource,
        validation: list[Batch],
        texts: FeatureStore,
        encoder: TextEncoder,
        data: str,
        device: torch.device,
    ) -> None:
        self.network = network
        self.model = FeatureStep(network)
        self.config = config
        self.batches = batches
        self.validation = validation
        self.texts = texts.to(device)
        self.encoder = encoder
        self.data = data
        self.device = device

    def _inputs(self, batch: Batch, dropped: Tensor, seed: int) -> FeatureInputs:
        text = self.texts.lookup(batch.captions)
        moved = FeatureBatch(batch.features.to(self.device), batch.lengths.to(self.device), text, dropped)
        return FeatureInputs(moved, torch.Generator().manual_seed(seed))

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the batch of `step`; caption drop, steps and noise are functions of (seed, step, rank)."""
        batch = self.batches.batch(step, rank, world)
        rng = np.random.default_rng([self.config.seed, 6, step])
        drop = rng.random(self.config.batch.size) < self.config.caption_drop
        dropped = on_device(drop[rank::world].copy(), self.device)
        loss, error = model(self._inputs(batch, dropped, int(rng.integers(2**62)) + rank))
        return loss, {"error": error}

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean squared error of the predicted motion on the validation split, true captions, the same noise always."""
        if not self.validation:
            return {}
        errors, counts = [], []
        for number, batch in enumerate(self.validation):
            nobody = torch.zeros(len(batch.lengths), dtype=torch.bool, device=self.device)
            errors.append(float(self.model(self._inputs(batch, nobody, number))[1]))
            counts.append(float(batch.lengths.sum()))
        return {"val_error": float(np.average(errors, weights=counts))}

    def export(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the shipped form: it carries the normaliser, for there is no tokenizer that would."""
        who, facts = identify(self.encoder), facts | {"seed": self.config.seed}
        card = Card("generator", self.network.config, who, self.data, facts, self.batches.normaliser)
        save_checkpoint(path, cast(nn.Module, self.network), card)
