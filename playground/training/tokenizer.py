"""Training a tokenizer: the loss of systems.md A7 with the terms of A9, B1 and D3, and its validation figures."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.checkpoints import Card, save_checkpoint
from playground.data.batches import Batch, BatchSource
from playground.motion.measures import mpjpe
from playground.motion.representation import Normaliser, from_features67
from playground.nn.transfer import on_device
from playground.text.encoders import TextEncoder, TextFeatures, identify
from playground.text.store import FeatureStore
from playground.tokenizers.base import Tokenizer, TrainingOutput
from playground.training.configs import TokenizerTraining

JOINTS = slice(4, None)  # columns of the joint positions
JUMP = 0.02  # of the normalised features: second differences beyond it count in proportion, not squared
HEADING_SCALE = 0.4  # radians of yaw that move an outstretched hand by about one standard deviation of the positions


def tokenizer_loss(
    out: TrainingOutput,
    features: Tensor,
    lengths: Tensor,
    config: TokenizerTraining,
    heading_std: float,
    mean_frames: float,
) -> Tensor:
    """smoothL1 on the features + weighted commitment (+ the terms of `config`); scalar. heading_std: std of column 0.

    mean_frames: what sums over real frames are divided by (see Batch).

    With masked_mean the mean runs over real frames, else over all frames with padding as exact zeros (systems.md H16).
    """
    short = features.shape[1] - out.features.shape[1]  # another process may hold the longest motion of the batch
    reconstruction = F.pad(out.features.float(), (0, 0, 0, short))
    real = torch.arange(features.shape[1], device=lengths.device)[None] < lengths[:, None]
    error = F.smooth_l1_loss(reconstruction, features, reduction="none").mean(dim=-1)
    loss = (error * real).sum() / mean_frames if config.masked_mean else error.mean()
    if config.heading:
        turned = ((reconstruction[..., 0] - features[..., 0]) * real).cumsum(dim=1) * (2 * heading_std / HEADING_SCALE)
        drift = F.smooth_l1_loss(turned, torch.zeros_like(turned), reduction="none") * real
        loss = loss + config.heading * drift.sum() / mean_frames
    if config.joints:
        apart = F.smooth_l1_loss(reconstruction[..., JOINTS], features[..., JOINTS], reduction="none").mean(dim=-1)
        loss = loss + config.joints * (apart * real).sum() / mean_frames
    if config.velocity:
        loss = loss + config.velocity * velocity_loss(reconstruction, features, lengths, mean_frames)
    return loss + config.commitment * out.commitment


def velocity_loss(out: Tensor, features: Tensor, lengths: Tensor, mean_frames: float) -> Tensor:
    """smoothL1 on the differences of successive rows of out and features [B, F, C], over real rows; scalar."""
    return _difference_loss(out, features, lengths, mean_frames, 1, 1.0)


def jump_loss(out: Tensor, features: Tensor, lengths: Tensor, mean_frames: float) -> Tensor:
    """smoothL1, straight beyond JUMP, on the second differences of rows of out and features [B, F, C], over real rows;
    scalar. Nearly straight everywhere, it minds the small jumps from patch to patch as much as the fast motions."""
    return _difference_loss(out, features, lengths, mean_frames, 2, JUMP)


def _difference_loss(
    out: Tensor, features: Tensor, lengths: Tensor, mean_frames: float, order: int, beta: float
) -> Tensor:
    inside = torch.arange(order, features.shape[1], device=lengths.device)[None] < lengths[:, None]
    made, real = (rows.diff(n=order, dim=1) for rows in (out, features))
    error = F.smooth_l1_loss(made, real, reduction="none", beta=beta).mean(dim=-1)
    return (error * inside).sum() / mean_frames


class TokenizerInputs:
    """One training batch on the device. Not a dataclass: Fabric would round its numbers to half precision."""

    def __init__(
        self, features: Tensor, lengths: Tensor, text: TextFeatures, dropped: Tensor, mean_frames: float
    ) -> None:
        self.features = features  # float32 [B, F, 67]
        self.lengths = lengths  # int64 [B]
        self.text = text
        self.dropped = dropped  # bool [B], no language
        self.mean_frames = mean_frames


class TokenizerStep(nn.Module):
    """One training pass, loss included: what Fabric wraps, so that every process sees the whole of it."""

    def __init__(self, model: Any, config: TokenizerTraining, heading_std: float) -> None:
        super().__init__()
        self.tokenizer = model
        self.config = config
        self.heading_std = heading_std

    def forward(self, batch: TokenizerInputs) -> tuple[Tensor, Tensor, Tensor]:
        """A batch -> loss, share of codes hit (mean over scales), commitment; scalars."""
        out = self.tokenizer(batch.features, batch.lengths, batch.text, batch.dropped)
        loss = tokenizer_loss(out, batch.features, batch.lengths, self.config, self.heading_std, batch.mean_frames)
        sizes = self.tokenizer.quantizer.codes
        used = [share_used(ids, codes) for ids, codes in zip(out.ids, sizes, strict=False)]
        return loss, torch.stack(used).mean(), out.commitment.detach()


def share_used(ids: Tensor, codes: int) -> Tensor:
    """Share of `codes` codes that occur in ids, a scalar on their device."""
    return torch.zeros(codes, device=ids.device).index_fill_(0, ids.flatten(), 1.0).mean()


class TokenizerTask:
    """One tokenizer run on batches of motions with captions."""

    def __init__(
        self,
        model: Tokenizer,
        config: TokenizerTraining,
        batches: BatchSource,
        validation: list[Batch],
        texts: FeatureStore,
        encoder: TextEncoder,
        data: str,
        device: torch.device,
    ) -> None:
        self.tokenizer = model
        self.model = TokenizerStep(model, config, float(batches.normaliser.std[0]))
        self.config = config
        self.batches = batches
        self.validation = validation
        self.texts = texts.to(device)
        self.encoder = encoder
        self.data = data
        self.device = device

    def _tensors(self, batch: Batch) -> tuple[Tensor, Tensor, TextFeatures]:
        text = self.texts.lookup(batch.captions)
        return batch.features.to(self.device), batch.lengths.to(self.device), text

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the batch of `step`; language drop is drawn from (seed, step) over the whole batch."""
        batch = self.batches.batch(step, rank, world)
        features, lengths, text = self._tensors(batch)
        rng = np.random.default_rng([self.config.seed, 1, step])
        drop = rng.random(self.config.batch.size) < self.config.language_drop
        dropped = on_device(drop[rank::world].copy(), self.device)
        loss, used, commitment = model(TokenizerInputs(features, lengths, text, dropped, batch.mean_frames))
        return loss, {"codes hit": used, "commitment": commitment}

    def validate(self) -> dict[str, float]:
        """MPJPE in mm on the validation split, over clips and as a mean over sources, true captions, g = 0."""
        if not self.validation:
            return {}
        return reconstruction_errors(self.tokenizer, self.validation, self.texts, self.batches.normaliser, self.device)

    def export(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the shipped form of the tokenizer."""
        card = Card(
            kind="tokenizer",
            config=self.tokenizer.config,
            encoder=identify(self.encoder),
            data=self.data,
            facts=facts | {"seed": self.config.seed},
            normaliser=self.batches.normaliser,
        )
        save_checkpoint(path, cast(nn.Module, self.tokenizer), card)


def reconstruction_errors(
    tokenizer: Tokenizer, batches: list[Batch], texts: FeatureStore, normaliser: Normaliser, device: torch.device
) -> dict[str, float]:
    """MPJPE in mm of whole clips, over clips, as a mean over sources and of each source; true captions, g = 0."""
    errors: dict[str, list[float]] = {}
    for batch in batches:
        features, lengths = batch.features.to(device), batch.lengths.to(device)
        text = texts.lookup(batch.captions)
        decoded = tokenizer.decode(tokenizer.encode(features, lengths, text).embedding, lengths, text)
        for row, (length, source) in enumerate(zip(batch.lengths.tolist(), batch.sources, strict=True)):
            error = clip_error(features[row, :length], decoded[row, :length], normaliser)
            errors.setdefault(source, []).append(error)
    means = {source: float(np.mean(values)) for source, values in errors.items()}
    everything = [value for values in errors.values() for value in values]
    figures = {"mpjpe_mm": float(np.mean(everything)), "mpjpe_mm_source_mean": float(np.mean(list(means.values())))}
    return figures | {f"mpjpe_mm {source}": value for source, value in sorted(means.items())}


def clip_error(features: Tensor, decoded: Tensor, normaliser: Normaliser) -> float:
    """MPJPE in mm of one clip: normalised rows [F, 67] against decoded ones."""
    truth = from_features67(normaliser.invert(features.cpu().numpy()))
    guess = from_features67(normaliser.invert(decoded.float().cpu().numpy()))
    return mpjpe(truth, guess)
