"""Where the tokens of every level lie on the latents: scales that are fixed, or counted from each motion's length.

Fixed scales (LG-Tok, MoSa; systems.md A6) resample all latents. Counted ones (MoMask, MoMask++, MOGO; B1, E3) have T
latents a motion and max(1, T // divisor) tokens on a level; a row of a padded batch is resampled as it would be alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional as F


def resample_down(x: Tensor, size: int) -> Tensor:
    """Area pooling along time: [B, T, D] -> [B, size, D]."""
    return x if x.shape[1] == size else F.adaptive_avg_pool1d(x.transpose(1, 2), size).transpose(1, 2)


def resample_up(x: Tensor, size: int) -> Tensor:
    """Linear interpolation along time, corners not aligned: [B, s, D] -> [B, size, D]."""
    if x.shape[1] == size:
        return x
    return F.interpolate(x.transpose(1, 2), size, mode="linear", align_corners=False).transpose(1, 2)


def pooling_weights(sizes: Tensor, lengths: Tensor, size: int, length: int) -> Tensor:
    """Area pooling of rows of their own length: sizes and lengths int64 [B] -> weights [B, size, length].

    Token i of a row averages its latents floor(i T / s) to ceil((i + 1) T / s) - 1; what is no token gets zeros.
    """
    token = torch.arange(size, device=lengths.device)[None]
    total, count = lengths[:, None], sizes[:, None]
    start, stop = token * total // count, -(-(token + 1) * total // count)
    latent = torch.arange(length, device=lengths.device)
    inside = (latent >= start[..., None]) & (latent < stop[..., None]) & (token < count)[..., None]
    return inside / (stop - start)[..., None]


def stretching_weights(sizes: Tensor, lengths: Tensor, size: int, length: int) -> Tensor:
    """Linear interpolation of rows of their own length, corners not aligned -> weights [B, length, size].

    Latent j of a row stands at token (j + 0.5) s / T - 0.5, held inside 0..s - 1; what is no latent gets zeros.
    """
    latent = torch.arange(length, device=lengths.device)[None]
    place = (latent + 0.5) * sizes[:, None] / lengths[:, None] - 0.5
    place = torch.minimum(place.clamp(min=0), sizes[:, None] - 1.0)
    hat = (1 - (place[..., None] - torch.arange(size, device=lengths.device)).abs()).clamp(min=0)
    return hat * (latent < lengths[:, None])[..., None]


@dataclass(frozen=True)
class FixedGrid:
    """The same number of tokens a level, whatever the motion."""

    scales: tuple[int, ...]

    def down(self, level: int, x: Tensor) -> Tensor:
        """Latents [B, T, D] -> one vector a token [B, s_n, D]."""
        return resample_down(x, self.scales[level])

    def up(self, x: Tensor, level: int) -> Tensor:
        """One vector a token [B, s_n, D] -> latents [B, T, D]."""
        return resample_up(x, self.scales[-1])

    def real(self, level: int | None) -> Tensor | None:
        """Which tokens are real: all, so None."""
        return None

    def clip(self, x: Tensor) -> Tensor:
        """Latents without what is no latent: all of them."""
        return x

    def whole(self, level: int) -> bool:
        """Whether a level has a token a latent."""
        return self.scales[level] == self.scales[-1]

    def energy(self, x: Tensor) -> Tensor:
        """Mean square of each row: [B, T, D] -> [B]."""
        return x.square().mean(dim=(1, 2))

    def mse(self, a: Tensor, b: Tensor) -> Tensor:
        """Mean squared difference of two [B, T, D]; scalar."""
        return F.mse_loss(a, b)


@dataclass(frozen=True, eq=False)
class CountedGrid:
    """Tokens counted from each row's own number of latents."""

    lengths: Tensor  # int64 [B], latents of each row
    length: int  # latents of the padded batch
    divisors: Sequence[int]  # latents a token, a level

    def _counts(self, level: int) -> Tensor:
        return (self.lengths // self.divisors[level]).clamp(min=1)

    def real(self, level: int | None) -> Tensor:
        """Which tokens of a level are real, bool [B, s_n]; level None: which latents, bool [B, T]."""
        counts = self.lengths if level is None else self._counts(level)
        size = self.length if level is None else max(1, self.length // self.divisors[level])
        return torch.arange(size, device=counts.device)[None] < counts[:, None]

    def down(self, level: int, x: Tensor) -> Tensor:
        """Latents [B, T, D] -> one vector a token [B, s_n, D], zeros where none is real."""
        if self.whole(level):
            return self.clip(x)
        size = max(1, self.length // self.divisors[level])
        return pooling_weights(self._counts(level), self.lengths, size, self.length).to(x.dtype) @ x

    def up(self, x: Tensor, level: int) -> Tensor:
        """One vector a token [B, s, D], s at least as many as are real -> latents [B, T, D], zeros beyond each row."""
        if self.whole(level):
            return self.clip(F.pad(x, (0, 0, 0, self.length - x.shape[1])))
        return stretching_weights(self._counts(level), self.lengths, x.shape[1], self.length).to(x.dtype) @ x

    def clip(self, x: Tensor) -> Tensor:
        """Latents [B, T, D] with zeros beyond each row."""
        return x * self.real(None)[..., None]

    def whole(self, level: int) -> bool:
        """Whether a level has a token a latent."""
        return self.divisors[level] == 1

    def energy(self, x: Tensor) -> Tensor:
        """Mean square of each row over its real latents: [B, T, D] -> [B]."""
        return self.clip(x).square().sum(dim=(1, 2)) / (self.lengths * x.shape[2])

    def mse(self, a: Tensor, b: Tensor) -> Tensor:
        """Mean squared difference of two [B, T, D] over the real latents of the batch; scalar."""
        return self.clip(a - b).square().sum() / (self.lengths.sum() * a.shape[2])


Grid = FixedGrid | CountedGrid
