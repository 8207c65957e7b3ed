"""Training the root refiner (systems.md E1): the root's turn and velocity from the body's own movement.

What it will read was decoded from tokens, a little wrong: too smooth, trembling, or drifting. So the joints that it is
shown are perturbed in the same ways, and two things are asked of it: the recorded root columns, and toes that move over
the ground as the recorded ones do, counted on the joints that it was shown.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from playground.checkpoints import Card, save_checkpoint
from playground.data.batches import Batch, BatchSource
from playground.generators.refiner import ROOT, RootRefiner
from playground.motion.measures import foot_sliding
from playground.motion.representation import Normaliser, from_features67
from playground.text.features import EncoderId
from playground.training.configs import RefinerTraining
from playground.training.feet import foot_loss

NO_TEXT = EncoderId("none", 0, "")  # it reads no text


def smoothed(x: Tensor, lengths: Tensor, times: Tensor) -> Tensor:
    """x [B, F, C], each row averaged with its neighbours (1/4, 1/2, 1/4) `times` [B] times; the ends repeat."""
    steps = torch.arange(x.shape[1], device=x.device)[None]
    last = (lengths[:, None] - 1).clamp(min=0)
    before, after = (steps - 1).clamp(min=0).expand(len(x), -1), torch.minimum(steps + 1, last)
    for done in range(int(times.max())):
        near = [x.gather(1, at[..., None].expand_as(x)) for at in (before, after)]
        x = torch.where((times > done)[:, None, None], 0.5 * x + 0.25 * (near[0] + near[1]), x)
    return x


def perturbed(features: Tensor, lengths: Tensor, config: RefinerTraining, rng: torch.Generator) -> Tensor:
    """Normalised rows [B, F, C] as a decoder might give them back; the root columns and padding stay as they are.

    Every motion draws how often it is smoothed, how much it trembles from frame to frame, and how much every joint
    drifts slowly; a share of them stays true.
    """
    device, (batch, frames, columns) = features.device, features.shape
    drawn = torch.rand(4, batch, generator=rng).to(device)
    times = (drawn[0] * (config.smoothing + 1)).long()
    white, slow = torch.randn(2, batch, frames, columns - ROOT, generator=rng).to(device)
    slow = smoothed(slow, lengths, times.new_full((batch,), config.slowness))
    slow = slow / slow.std().clamp(min=1e-6)
    levels = (drawn[1:3] ** 2)[..., None, None] * torch.tensor([config.tremble, config.drift], device=device).view(
        2, 1, 1, 1
    )
    local = smoothed(features[..., ROOT:], lengths, times) + levels[0] * white + levels[1] * slow
    real = torch.arange(frames, device=device)[None] < lengths[:, None]
    shown = (real & (drawn[3] >= config.true)[:, None])[..., None]
    return torch.cat([features[..., :ROOT], torch.where(shown, local, features[..., ROOT:])], dim=-1)


class RefinerInputs:
    """One training batch on the device. Not a dataclass: Fabric would round its numbers to half precision."""

    def __init__(self, batch: Batch, shown: Tensor) -> None:
        self.batch = batch
        self.shown = shown  # float32 [B, F, 67], the perturbed rows


class RefinerStep(nn.Module):
    """One training pass, loss included: what Fabric wraps."""

    def __init__(self, network: RootRefiner, config: RefinerTraining, normaliser: Normaliser) -> None:
        super().__init__()
        self.network = network
        self.config = config
        self.mean: Tensor
        self.std: Tensor
        self.register_buffer("mean", torch.from_numpy(normaliser.mean.copy()), persistent=False)
        self.register_buffer("std", torch.from_numpy(normaliser.std.copy()), persistent=False)

    def forward(self, inputs: RefinerInputs) -> tuple[Tensor, Tensor]:
        """A batch -> loss and its part for feet; scalars."""
        batch = inputs.batch
        root = self.network(inputs.shown, batch.lengths).float()
        error = F.smooth_l1_loss(root, batch.features[..., :ROOT], reduction="none").mean(dim=-1)
        real = torch.arange(root.shape[1], device=root.device)[None] < batch.lengths[:, None]
        loss = (error * real).sum() / batch.mean_frames
        refined = torch.cat([root, inputs.shown[..., ROOT:]], dim=-1)
        out, true = (rows * self.std + self.mean for rows in (refined, batch.features))
        feet = foot_loss(out, true, batch.lengths, batch.mean_frames)
        return loss + self.config.feet * feet, feet.detach()


class RefinerTask:
    """One run on batches of motions; captions are not read."""

    def __init__(
        self,
        network: RootRefiner,
        config: RefinerTraining,
        batches: BatchSource,
        validation: list[Batch],
        data: str,
        device: torch.device,
    ) -> None:
        self.network = network
        self.model = RefinerStep(network, config, batches.normaliser)
        self.config = config
        self.batches = batches
        self.validation = validation
        self.data = data
        self.device = device

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the batch of `step`; what is done to the joints is a function of (seed, step, rank)."""
        batch = self.batches.batch(step, rank, world)
        seed = int(np.random.default_rng([self.config.seed, 7, step]).integers(2**62)) + rank
        shown = perturbed(batch.features, batch.lengths, self.config, torch.Generator().manual_seed(seed))
        loss, feet = model(RefinerInputs(batch, shown))
        return loss, {"feet": feet}

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Predicted against recorded root on whole clips of the validation split (`root_figures`), clips alike."""
        rows: list[dict[str, float]] = []
        for batch in self.validation:
            root = self.network(batch.features.to(self.device), batch.lengths.to(self.device)).cpu()
            made = torch.cat([root, batch.features[..., ROOT:]], dim=-1)
            for true, guess, length in zip(batch.features, made, batch.lengths.tolist(), strict=True):
                pair = [self.batches.normaliser.invert(x[:length].numpy()) for x in (true, guess)]
                rows.append(root_figures(*pair))
        return {f"val_{key}": float(np.nanmean([row[key] for row in rows])) for key in rows[0]} if rows else {}

    def export(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the shipped form, with the normaliser of what it reads."""
        facts = facts | {"seed": self.config.seed}
        card = Card("refiner", self.network.config, NO_TEXT, self.data, facts, self.batches.normaliser)
        save_checkpoint(path, self.network, card)


def root_figures(true: NDArray[np.float32], guess: NDArray[np.float32]) -> dict[str, float]:
    """Un-normalised rows [F, 67] with recorded and with predicted root -> what tells them apart.

    velocity_mm: error of the root's velocity, mm a frame, mean over frames; heading_degrees: how far the heading is off
    at the end of the clip; sliding, sliding_true: foot sliding in mm/s of the recovered motion, nan without contact.
    """
    turned = 2.0 * (guess[:, 0].astype(np.float64) - true[:, 0]).sum()
    return {
        "velocity_mm": float(np.linalg.norm(guess[:, 1:3] - true[:, 1:3], axis=-1).mean() * 1000.0),
        "heading_degrees": float(abs(np.degrees(turned))),
        "sliding": foot_sliding(from_features67(guess)),
        "sliding_true": foot_sliding(from_features67(true)),
    }
