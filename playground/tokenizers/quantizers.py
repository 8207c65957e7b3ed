"""Vector quantization: the one nearest-code lookup, EMA codebooks, the multi-scale residual quantizer (systems.md A6).

With equal scales as long as the latents, phi "identity" and the Euclidean metric it is MoMask's plain residual
quantizer (A11, B1); noisy look-ups (`draw`) and kept prefixes (`level_drop`) are for that one.
Ideas: VAR's multi-scale residual quantizer (MIT), EMA codebooks of VQ-VAE-2 and encodec (MIT); code written here.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.nn.linear import Conv3
from playground.nn.modules import module_list
from playground.tokenizers.base import Quantized, Tokens

PHIS = ("conv", "residual", "identity")
METRICS = ("cosine", "euclidean")


def nearest_code(vectors: Tensor, codebook: Tensor, metric: str, temperature: float = 0.0) -> Tensor:
    """Index of the nearest code: vectors [..., D], codebook [V, D] -> int64 [...]. Ties go to the lower index.

    `cosine` takes the largest normalised dot product (A6), `euclidean` the smallest distance. A temperature above 0
    draws instead, with Gumbel noise: code v has probability softmax(closeness / temperature), closeness being the
    cosine or minus the squared distance (B1; for training).
    """
    if metric == "cosine":
        score = vectors @ F.normalize(codebook, dim=-1).T
    elif metric == "euclidean":
        score = vectors @ codebook.T - 0.5 * codebook.square().sum(dim=-1)  # half the closeness, but for a constant
    else:
        raise ValueError(f"unknown metric {metric!r}; accepted: {', '.join(METRICS)}")
    if temperature > 0:
        close = 2 * score if metric == "euclidean" else score / vectors.norm(dim=-1, keepdim=True).clamp(min=1e-12)
        score = close / temperature - torch.empty_like(score).exponential_().log()
    return score.argmax(dim=-1)


def resample_down(x: Tensor, size: int) -> Tensor:
    """Area pooling along time: [B, T, D] -> [B, size, D]."""
    return x if x.shape[1] == size else F.adaptive_avg_pool1d(x.transpose(1, 2), size).transpose(1, 2)


def resample_up(x: Tensor, size: int) -> Tensor:
    """Linear interpolation along time, corners not aligned: [B, s, D] -> [B, size, D]."""
    if x.shape[1] == size:
        return x
    return F.interpolate(x.transpose(1, 2), size, mode="linear", align_corners=False).transpose(1, 2)


def _distributed() -> bool:
    return torch.distributed.is_available() and torch.distributed.is_initialized()


def _from_first_process(x: Tensor) -> Tensor:
    """The first process's x on every process; x itself where there is one process."""
    if _distributed():
        x = x.contiguous()
        torch.distributed.broadcast(x, src=0)
    return x


class Codebook(nn.Module):
    """V code vectors of width D learned as moving averages (decay 0.99) of the vectors that choose them."""

    def __init__(self, codes: int, width: int, *, metric: str, decay: float = 0.99) -> None:
        super().__init__()
        self.metric = metric
        self.decay = decay
        self.vectors: Tensor
        self.sums: Tensor
        self.counts: Tensor
        self.register_buffer("vectors", torch.zeros(codes, width))
        self.register_buffer("sums", torch.zeros(codes, width))
        self.register_buffer("counts", torch.zeros(codes))

    def lookup(self, vectors: Tensor, temperature: float = 0.0) -> Tensor:
        """Nearest code of each vector [..., D] -> int64 [...]; with a temperature a noisy one (see nearest_code)."""
        return nearest_code(vectors, self.vectors, self.metric, temperature)

    def fill(self, vectors: Tensor) -> Tensor:
        """Leading V rows of vectors [n, D]; rows tiled with noise of std 0.01 / sqrt(D) where n < V."""
        size, width = self.vectors.shape
        if len(vectors) < size:
            tiled = vectors.repeat(-(-size // len(vectors)), 1)
            vectors = tiled + torch.randn_like(tiled) * (0.01 / width**0.5)
        return vectors[:size]

    @torch.no_grad()
    def start(self, vectors: Tensor) -> None:
        """Take the first codes from a batch of vectors [n, D] (A6, init)."""
        self.vectors.copy_(_from_first_process(self.fill(vectors)))
        self.sums.copy_(self.vectors)
        self.counts.fill_(1.0)

    @torch.no_grad()
    def learn(self, vectors: Tensor, ids: Tensor) -> None:
        """One EMA step on vectors [n, D] with their codes [n]; codes counted below 1 restart from the batch."""
        counts = torch.zeros_like(self.counts).index_add_(0, ids, torch.ones_like(vectors[:, 0]))
        sums = torch.zeros_like(self.sums).index_add_(0, ids, vectors)
        if _distributed():
            torch.distributed.all_reduce(counts)
            torch.distributed.all_reduce(sums)
        self.counts.lerp_(counts, 1 - self.decay)
        self.sums.lerp_(sums, 1 - self.decay)
        alive = (self.counts >= 1.0)[:, None]
        average = self.sums / self.counts.clamp(min=1e-5)[:, None]
        spare = _from_first_process(self.fill(vectors))
        self.vectors.copy_(torch.where(alive, average, spare))


class Phi(nn.Module):
    """What an up-sampled scale passes through before it is added.

    conv: twice convolution kernel 3 and ReLU without a residual path (A6, as released); residual: half the input plus
    half a convolution (VAR); identity: the plain sum of the paper's text.
    """

    def __init__(self, width: int, kind: str) -> None:
        super().__init__()
        if kind not in PHIS:
            raise ValueError(f"unknown phi {kind!r}; accepted: {', '.join(PHIS)}")
        self.kind = kind
        count = {"conv": 2, "residual": 1, "identity": 0}[kind]
        self.convs = module_list(Conv3(width, width) for _ in range(count))

    def forward(self, x: Tensor) -> Tensor:
        """x [B, T, D] -> [B, T, D]."""
        if self.kind == "identity":
            return x
        if self.kind == "residual":
            return 0.5 * (x + self.convs[0](x))
        for conv in self.convs:
            x = conv(x, relu=True)
        return x


@dataclass(frozen=True, eq=False)
class TrainingQuantized:
    """What one training step needs from the quantizer."""

    embedding: Tensor  # [B, T, D], straight-through: value of the sum, gradient of z
    commitment: Tensor  # scalar
    ids: tuple[Tensor, ...]  # pooled tokens, [B, s_n] a level used; a dropped level has none


class MultiScaleQuantizer(nn.Module):
    """Residual quantization over growing numbers of tokens, each scale with its own codebook and phi (A6).

    In training, codes are drawn with Gumbel noise of temperature `draw`, and a share `level_drop` of the steps uses a
    random prefix of the levels only, from 1 to all (B1); both are 0 in LG-Tok.
    """

    def __init__(
        self,
        scales: Sequence[int],
        codes: Sequence[int],
        width: int,
        *,
        metric: str = "cosine",
        phi: str = "conv",
        draw: float = 0.0,
        level_drop: float = 0.0,
    ) -> None:
        super().__init__()
        if len(scales) != len(codes):
            raise ValueError(f"{len(scales)} scales need as many codebook sizes, got {len(codes)}")
        self.scales = tuple(scales)
        self.draw = draw
        self.level_drop = level_drop
        self.codebooks = module_list(Codebook(v, width, metric=metric) for v in codes)
        self.phis = module_list(Phi(width, phi) for _ in scales)
        self.started: Tensor
        self.register_buffer("started", torch.zeros((), dtype=torch.bool))
        self._known_started = False  # what `started` says, once it says yes: asking a GPU would wait for it

    @property
    def length(self) -> int:
        """Number of latents T: the finest scale."""
        return self.scales[-1]

    @property
    def codes(self) -> tuple[int, ...]:
        """Codebook sizes V_n."""
        return tuple(len(book.counts) for book in self.codebooks)

    def share(self, level: int, ids: Tensor) -> Tensor:
        """What level number `level` (from 0) adds to the embedding: ids [B, s_n] -> [B, T, D]."""
        return self.share_of_vectors(level, F.embedding(ids, self.codebooks[level].vectors))

    def share_of_vectors(self, level: int, vectors: Tensor) -> Tensor:
        """The same for code vectors [B, s_n, D] -> [B, T, D]."""
        return self.phis[level](resample_up(vectors, self.length))

    def encode(self, z: Tensor) -> Quantized:
        """Latents z [B, T, D] -> Quantized."""
        residual = z.float()
        ids, shares, norms = [], [], [residual.square().mean(dim=(1, 2))]
        for level, size in enumerate(self.scales):
            ids.append(self.codebooks[level].lookup(resample_down(residual, size)))
            shares.append(self.share(level, ids[-1]))
            residual = residual - shares[-1]
            norms.append(residual.square().mean(dim=(1, 2)))
        per_level = torch.stack(shares)
        return Quantized(Tokens(tuple(ids), self.codes), per_level.sum(dim=0), per_level, torch.stack(norms))

    def accumulate(self, ids: Sequence[Tensor]) -> Iterator[Tensor]:
        """Running sums [B, T, D] of the shares, one after each level of ids [B, s_n], coarse to fine."""
        total: Tensor | None = None
        for level, level_ids in enumerate(ids):
            share = self.share(level, level_ids)
            total = share if total is None else total + share
            yield total

    def embed(self, tokens: Tokens, levels: int | None = None) -> Tensor:
        """Sum of the shares of the coarsest `levels` scales (all by default) -> [B, T, D]; 0 levels give zeros."""
        total = torch.zeros_like(self.share(0, tokens.ids[0]))
        for running in self.accumulate(tokens.ids[: len(tokens) if levels is None else levels]):
            total = running
        return total

    def forward(self, z: Tensor) -> TrainingQuantized:
        """Latents z [B, T, D] of a training batch -> TrainingQuantized; codebooks move by one EMA step (A6).

        The EMA is fed with the full-length residuals and their own nearest codes, not with the pooled vectors.
        """
        with torch.autocast(z.device.type, enabled=False):  # always in float32 (A6, precision)
            return self._train(z.float())

    def _train(self, z: Tensor) -> TrainingQuantized:
        if self.training and not self._known_started:
            if not bool(self.started):
                for book in self.codebooks:
                    book.start(z.detach().flatten(0, 1))
                self.started.fill_(True)
            self._known_started = True
        residual, total = z.detach(), torch.zeros_like(z)
        ids = []
        commitment = z.new_zeros(())
        noise = self.draw if self.training else 0.0
        for level, size in enumerate(self.scales[: self._levels_used()]):
            book = self.codebooks[level]
            ids.append(book.lookup(resample_down(residual, size), noise))
            share = self.share(level, ids[-1])
            if self.training:
                flat = residual.flatten(0, 1)
                book.learn(flat, ids[-1].flatten() if size == self.length else book.lookup(flat, noise))
            total = total + share
            residual = residual - share.detach()
            commitment = commitment + F.mse_loss(total.detach(), z) + F.mse_loss(total, z.detach())
        straight = z + (total - z).detach()
        return TrainingQuantized(straight, commitment / len(ids), tuple(ids))

    def _levels_used(self) -> int:
        """How many levels this training step uses: all, or the same random prefix on every process (B1)."""
        levels = len(self.scales)
        if not self.training or not self.level_drop:
            return levels
        coin, place = _from_first_process(torch.rand(2, device=self.started.device)).tolist()
        return levels if coin >= self.level_drop else 1 + int(place * levels)
