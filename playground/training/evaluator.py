"""Training the evaluators: the TMR-style losses (systems.md E5) and the CLIP-style one (F1)."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, distributed, nn
from torch.nn import functional as F

from playground.checkpoints import Card, save_checkpoint
from playground.data.batches import BatchSource, Sample
from playground.evaluation.evaluators import Evaluator
from playground.evaluation.networks import ContrastiveNetwork, Gaussian, TMRNetwork
from playground.evaluation.retrieval import retrieval
from playground.nn.transfer import on_device
from playground.text.encoders import TextEncoder, TextFeatures, identify
from playground.text.store import FeatureStore
from playground.training.configs import EvaluatorTraining


def divergence(q: Gaussian, p: Gaussian) -> Tensor:
    """Kullback-Leibler divergence of q from p, mean over batch and dimensions; scalar (TMR's reading of E5)."""
    ratio = q.log_variance - p.log_variance
    return 0.5 * (ratio.exp() + (q.mean - p.mean) ** 2 / p.log_variance.exp() - 1 - ratio).mean()


def contrast(motions: Tensor, texts: Tensor, scale: Tensor | float, alike: Tensor) -> tuple[Tensor, Tensor]:
    """Symmetric InfoNCE of cosines times `scale`, and the share of texts whose own motion is nearest; scalars.

    motions, texts: [B, L], row by row a pair. alike: bool [B, B]; those pairs are no negatives.
    """
    cosines = F.normalize(texts, dim=-1) @ F.normalize(motions, dim=-1).T
    own = torch.eye(len(texts), dtype=torch.bool, device=texts.device)
    logits = (cosines * scale).masked_fill(alike & ~own, float("-inf"))
    target = torch.arange(len(texts), device=texts.device)
    loss = (F.cross_entropy(logits, target) + F.cross_entropy(logits.T, target)) / 2
    return loss, (logits.argmax(dim=1) == target).float().mean()


def gathered(rows: Tensor) -> Tensor:
    """[b, ...] of this process -> [B, ...] of all; only the own rows carry gradients."""
    if not distributed.is_initialized() or distributed.get_world_size() == 1:
        return rows
    parts = [torch.empty_like(rows) for _ in range(distributed.get_world_size())]
    distributed.all_gather(parts, rows.detach().contiguous())
    parts[distributed.get_rank()] = rows
    return torch.cat(parts)


def shared(loss: Tensor) -> Tensor:
    """A loss of the whole batch that every process computes, with gradients that average to those of one process."""
    world = distributed.get_world_size() if distributed.is_initialized() else 1
    return world * loss - (world - 1) * loss.detach()


def common(value: Tensor | float) -> Tensor | float:
    """A number that every process uses whole: after `shared` its gradient is that of one process."""
    if not isinstance(value, Tensor) or not distributed.is_initialized():
        return value
    world = distributed.get_world_size()
    return value / world + value.detach() * (1 - 1 / world)


class EvaluatorInputs:
    """One training batch on the device. Not a dataclass: Fabric would round its numbers to half precision."""

    def __init__(
        self, features: Tensor, lengths: Tensor, text: TextFeatures, noise: Tensor, mean_frames: float
    ) -> None:
        self.features = features  # float32 [B, F, 67]
        self.lengths = lengths  # int64 [B]
        self.text = text
        self.noise = noise  # standard normal [B, 2, L]: for the motion's latent and for the text's
        self.mean_frames = mean_frames


class EvaluatorStep(nn.Module):
    """One training pass, loss included: what Fabric wraps."""

    def __init__(self, network: TMRNetwork | ContrastiveNetwork, config: EvaluatorTraining) -> None:
        super().__init__()
        self.network = network
        self.config = config

    def forward(self, batch: EvaluatorInputs) -> tuple[Tensor, Tensor, Tensor]:
        """A batch -> loss, InfoNCE, share of texts whose own motion is nearest in the batch; scalars."""
        if isinstance(self.network, TMRNetwork):
            return self._variational(self.network, batch)
        motions = self.network.embed_motion(batch.features, batch.lengths)
        loss, right = self._contrast(motions, self.network.embed_text(batch.text), batch, self.network.scale())
        return loss, loss.detach(), right

    def _contrast(
        self, motions: Tensor, texts: Tensor, batch: EvaluatorInputs, scale: Tensor | float
    ) -> tuple[Tensor, Tensor]:
        """`contrast` over the whole batch of all processes, in float32."""
        with torch.autocast(motions.device.type, enabled=False):
            pooled = F.normalize(gathered(batch.text.pooled.float()), dim=-1)
            alike = pooled @ pooled.T >= self.config.alike
            loss, right = contrast(gathered(motions.float()), gathered(texts.float()), common(scale), alike)
            return shared(loss), right

    def _variational(self, network: TMRNetwork, batch: EvaluatorInputs) -> tuple[Tensor, Tensor, Tensor]:
        motion = _float(network.motion_distribution(batch.features, batch.lengths))
        text = _float(network.text_distribution(batch.text))
        latents = torch.stack([motion.sample(batch.noise[:, 0]), text.sample(batch.noise[:, 1])])
        decoded = network.decode(latents.flatten(0, 1), batch.lengths.repeat(2)).float()
        nearest, right = self._contrast(motion.mean, text.mean, batch, 1 / self.config.temperature)
        c = self.config
        loss = (
            c.reconstruction * reconstruction_loss(decoded, batch.features, batch.lengths, batch.mean_frames)
            + c.divergence * four_divergences(motion, text)
            + c.latent * F.smooth_l1_loss(latents[0], latents[1])
            + c.contrast * nearest
        )
        return loss, nearest.detach(), right


def _float(what: Gaussian) -> Gaussian:
    return Gaussian(what.mean.float(), what.log_variance.float())


def four_divergences(motion: Gaussian, text: Gaussian) -> Tensor:
    """The four KL terms of E5: either from the other, and both from the standard normal; scalar."""
    normal = Gaussian(torch.zeros_like(motion.mean), torch.zeros_like(motion.mean))
    pairs = ((text, motion), (motion, text), (motion, normal), (text, normal))
    return torch.stack([divergence(q, p) for q, p in pairs]).sum()


def reconstruction_loss(decoded: Tensor, features: Tensor, lengths: Tensor, mean_frames: float) -> Tensor:
    """smoothL1 of the motions decoded from motion and text latents, [2B, F, C], each over real frames; their sum.

    mean_frames: what sums over real frames are divided by (see Batch).
    """
    decoded = F.pad(decoded, (0, 0, 0, features.shape[1] - decoded.shape[1]))
    real = torch.arange(features.shape[1], device=lengths.device)[None] < lengths[:, None]
    error = F.smooth_l1_loss(decoded, features.repeat(2, 1, 1), reduction="none").mean(dim=-1)
    return (error * real.repeat(2, 1)).sum() / mean_frames


class EvaluatorTask:
    """One evaluator run on batches of motions with captions."""

    def __init__(
        self,
        network: TMRNetwork | ContrastiveNetwork,
        config: EvaluatorTraining,
        batches: BatchSource,
        held_out: dict[str, list[Sample]],
        texts: FeatureStore,
        encoder: TextEncoder,
        data: str,
        device: torch.device,
    ) -> None:
        self.network = network
        self.model = EvaluatorStep(network, config)
        self.config = config
        self.batches = batches
        self.held_out = held_out  # split -> its clips
        self.texts = texts.to(device)
        self.encoder = encoder
        self.data = data
        self.device = device

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the batch of `step`; the noise of the latents is drawn from (seed, step) over the whole batch."""
        batch = self.batches.batch(step, rank, world)
        rng = np.random.default_rng([self.config.seed, 5, step])
        noise = rng.standard_normal((self.config.batch.size, 2, self.config.model.latent), np.float32)
        inputs = EvaluatorInputs(
            batch.features.to(self.device),
            batch.lengths.to(self.device),
            self.texts.lookup(batch.captions),
            on_device(noise[rank::world].copy(), self.device),
            batch.mean_frames,
        )
        loss, nearest, right = model(inputs)
        return loss, {"InfoNCE": nearest, "right": right}

    def _retrieval(self, split: str) -> dict[str, Any] | None:
        """Retrieval figures of a split in evaluation mode; None where it holds no clip."""
        if not self.held_out.get(split):
            return None
        self.network.eval()
        evaluator = Evaluator(self.config.model.kind, self.network, self.batches.normaliser, self.texts.lookup)
        return retrieval(evaluator, self.held_out[split])

    def validate(self) -> dict[str, float]:
        """R-Precision on the validation split, own motion only."""
        figures = self._retrieval("val") or {}
        return {
            f"val_r_precision_{top}_{pool}": table["own"][top]["mean"]
            for pool, table in figures.items()
            if pool.startswith("pool")
            for top in table["own"]
        }

    def export(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the shipped form of the evaluator, with its retrieval figures on the test split."""
        c = self.config
        facts = facts | {"seed": c.seed, "batch": c.batch.size, "alike": c.alike}
        facts |= {"split": "test", "retrieval": self._retrieval("test")}
        who = identify(self.encoder)
        card = Card("evaluator", self.network.config, who, self.data, facts, self.batches.normaliser)
        save_checkpoint(path, self.network, card)
