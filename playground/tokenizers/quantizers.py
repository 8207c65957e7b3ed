"""Vector quantization: the one nearest-code lookup, EMA codebooks, the multi-scale residual quantizer (systems.md A6).

With equal scales as long as the latents, phi "identity" and the Euclidean metric it is MoMask's plain residual
quantizer (A11, B1); noisy look-ups (`draw`) and kept prefixes (`level_drop`) are for that one. `shared` is MoMask++'s
single codebook (E3), `affine` with `penalties` MOGO's MoSA-VQ (C1); `divisors` count tokens from each motion's length.
Ideas: VAR's multi-scale residual quantizer (MIT), EMA codebooks of VQ-VAE-2 and encodec (MIT); code written here.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.nn.linear import Conv3
from playground.nn.modules import module_list
from playground.tokenizers.affine import OUTER, Affine, Penalties, cross_covariance
from playground.tokenizers.base import Quantized, Tokens
from playground.tokenizers.grids import CountedGrid, FixedGrid, Grid

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

    def __init__(self, codes: int, width: int, *, metric: str, decay: float = 0.99, enough: int = 0) -> None:
        super().__init__()
        self.metric = metric
        self.decay = decay
        self.enough = enough  # codes restart only from batches of more than so many vectors a code (E3)
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
        """One EMA step on vectors [n, D] with their codes [n]; codes counted below 1 restart from the batch.

        From a batch that is too small for that (`enough`) they do not, but go on as averages.
        """
        counts = torch.zeros_like(self.counts).index_add_(0, ids, torch.ones_like(vectors[:, 0]))
        sums = torch.zeros_like(self.sums).index_add_(0, ids, vectors)
        if _distributed():
            torch.distributed.all_reduce(counts)
            torch.distributed.all_reduce(sums)
        self.counts.lerp_(counts, 1 - self.decay)
        self.sums.lerp_(sums, 1 - self.decay)
        average = self.sums / self.counts.clamp(min=1e-5)[:, None]
        if self.enough and float(counts.sum()) <= self.enough * len(counts):
            self.vectors.copy_(torch.where((self.counts >= 1e-5)[:, None], average, self.vectors))
            return
        alive = (self.counts >= 1.0)[:, None]
        spare = _from_first_process(self.fill(vectors))
        self.vectors.copy_(torch.where(alive, average, spare))


class SharedCodebook(nn.ModuleList):
    """One codebook that every level calls its own, stored once."""

    def __init__(self, book: Codebook, levels: int) -> None:
        super().__init__()
        self.add_module("0", book)
        self.levels = levels

    def __len__(self) -> int:
        return self.levels

    def __iter__(self) -> Iterator[nn.Module]:
        return (self[level] for level in range(self.levels))

    def __getitem__(self, level: int) -> nn.Module:  # type: ignore[override]
        range(self.levels)[level]  # IndexError beyond the last level, as in any list
        return self.get_submodule("0")


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

    scales: tokens a level at full length. With divisors, a motion of T latents has max(1, T // divisor) of them on a
    level, calls take the number of latents of each row (int64 [B]), and nothing beyond a row's own counts.
    shared: all levels look up in one codebook, which learns from the tokens of all levels together (E3); `enough` is
    its rule for restarting codes. affine: every level looks up W r + b and adds W^-1 (q - b) (C1). penalties: C1's
    loss in the place of A6's.
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
        divisors: Sequence[int] | None = None,
        shared: bool = False,
        enough: int = 0,
        affine: bool = False,
        penalties: Penalties | None = None,
    ) -> None:
        super().__init__()
        if len(scales) != len(codes):
            raise ValueError(f"{len(scales)} scales need as many codebook sizes, got {len(codes)}")
        if divisors is not None and len(divisors) != len(scales):
            raise ValueError(f"{len(scales)} scales need as many divisors, got {len(divisors)}")
        if shared and len(set(codes)) > 1:
            raise ValueError(f"a shared codebook has one size, got {len(set(codes))}")
        self.scales = tuple(scales)
        self.divisors = None if divisors is None else tuple(divisors)
        self.draw = draw
        self.level_drop = level_drop
        self.shared = shared
        self.penalties = penalties
        books = [Codebook(v, width, metric=metric, enough=enough) for v in (codes[:1] if shared else codes)]
        self.codebooks: list[Codebook] = (
            cast("list[Codebook]", SharedCodebook(books[0], len(codes))) if shared else module_list(books)
        )
        self.phis = module_list(Phi(width, phi) for _ in scales)
        self.affines = module_list(Affine(width) for _ in (scales if affine else ()))
        self.started: Tensor
        self.register_buffer("started", torch.zeros((), dtype=torch.bool))
        self._known_started = False  # what `started` says, once it says yes: asking a GPU would wait for it

    @property
    def length(self) -> int:
        """Number of latents T at full length: the finest scale."""
        return self.scales[-1]

    @property
    def codes(self) -> tuple[int, ...]:
        """Codebook sizes V_n."""
        return tuple(len(book.counts) for book in self.codebooks)

    def _grid(self, lengths: Tensor | None, length: int | None = None, ids: Sequence[Tensor] = ()) -> Grid:
        """The grid of a batch. Without lengths all rows are as long as the ids of a level with a token a latent."""
        if self.divisors is None:
            return FixedGrid(self.scales)
        if lengths is None:
            whole = [i for i, divisor in zip(ids, self.divisors, strict=False) if divisor == 1]
            if not whole:
                raise ValueError("the numbers of latents are needed where no level has a token a latent")
            lengths = torch.full((len(whole[0]),), whole[0].shape[1], device=whole[0].device)
        return CountedGrid(lengths, int(lengths.max()) if length is None else length, self.divisors)

    def share(self, level: int, ids: Tensor, lengths: Tensor | None = None) -> Tensor:
        """What level number `level` (from 0) adds to the embedding: ids [B, s_n] -> [B, T, D]."""
        return self._share(level, ids, self._level_grid(level, ids, lengths))

    def share_of_vectors(self, level: int, vectors: Tensor, lengths: Tensor | None = None) -> Tensor:
        """The same for code vectors [B, s_n, D] -> [B, T, D]."""
        return self._spread(level, vectors, self._level_grid(level, vectors, lengths))

    def _level_grid(self, level: int, tokens: Tensor, lengths: Tensor | None) -> Grid:
        return self._grid(lengths, ids=[tokens[:, :0]] * level + [tokens])

    def _share(self, level: int, ids: Tensor, grid: Grid) -> Tensor:
        return self._spread(level, F.embedding(ids, self.codebooks[level].vectors), grid)

    def _spread(self, level: int, vectors: Tensor, grid: Grid) -> Tensor:
        if self.affines:
            vectors = self.affines[level].inverse(vectors)
        return grid.clip(self.phis[level](grid.up(vectors, level)))

    def _sought(self, level: int, residual: Tensor) -> Tensor:
        """What is looked up for a residual [..., D] of a level."""
        return self.affines[level](residual).detach() if self.affines else residual

    def encode(self, z: Tensor, lengths: Tensor | None = None) -> Quantized:
        """Latents z [B, T, D] -> Quantized. lengths: how many of them are real, all by default."""
        grid = self._grid(lengths, z.shape[1], [z] * len(self.scales))
        residual = grid.clip(z.float())
        ids, shares, norms = [], [], [grid.energy(residual)]
        for level, book in enumerate(self.codebooks):
            ids.append(_choose(book, self._sought(level, grid.down(level, residual)), grid.real(level)))
            shares.append(self._share(level, ids[-1], grid))
            residual = residual - shares[-1]
            norms.append(grid.energy(residual))
        per_level = torch.stack(shares)
        return Quantized(Tokens(tuple(ids), self.codes), per_level.sum(dim=0), per_level, torch.stack(norms))

    def accumulate(self, ids: Sequence[Tensor], lengths: Tensor | None = None) -> Iterator[Tensor]:
        """Running sums [B, T, D] of the shares, one after each level of ids [B, s_n], coarse to fine."""
        return self._sums(ids, self._grid(lengths, ids=ids))

    def _sums(self, ids: Sequence[Tensor], grid: Grid) -> Iterator[Tensor]:
        total: Tensor | None = None
        for level, level_ids in enumerate(ids):
            share = self._share(level, level_ids, grid)
            total = share if total is None else total + share
            yield total

    def embed(self, tokens: Tokens, levels: int | None = None, lengths: Tensor | None = None) -> Tensor:
        """Sum of the shares of the coarsest `levels` scales (all by default) -> [B, T, D]; 0 levels give zeros."""
        grid = self._grid(lengths, ids=tokens.ids)
        total = torch.zeros_like(self._share(0, tokens.ids[0], grid))
        for running in self._sums(tokens.ids[: len(tokens) if levels is None else levels], grid):
            total = running
        return total

    def forward(self, z: Tensor, lengths: Tensor | None = None) -> TrainingQuantized:
        """Latents z [B, T, D] of a training batch -> TrainingQuantized; codebooks move by one EMA step (A6).

        The EMA is fed with the full-length residuals and their own nearest codes, not with the pooled vectors; that of
        a shared codebook with the pooled vectors of all levels (E3). lengths as in `encode`.
        """
        with torch.autocast(z.device.type, enabled=False):  # always in float32 (A6, precision)
            return self._train(z.float(), self._grid(lengths, z.shape[1], [z] * len(self.scales)))

    def _train(self, z: Tensor, grid: Grid) -> TrainingQuantized:
        z = grid.clip(z)
        if self.training:
            self._start(z.detach(), grid)
        residual, total = z.detach(), torch.zeros_like(z)
        ids: list[Tensor] = []
        commitment = z.new_zeros(())
        fed: list[Tensor] = []  # what a shared codebook learns from
        noise = self.draw if self.training else 0.0
        for level in range(self._levels_used()):
            book, real = self.codebooks[level], grid.real(level)
            pooled = self._sought(level, grid.down(level, residual))
            ids.append(_choose(book, pooled, real, noise))
            share = self._share(level, ids[-1], grid)
            if self.training and self.shared:
                fed.append(pooled)
            elif self.training:
                flat = _real(self._sought(level, residual), grid.real(None))
                book.learn(flat, _real(ids[-1], real) if grid.whole(level) else book.lookup(flat, noise))
            if self.penalties is None:
                total = total + share
                commitment = commitment + grid.mse(total.detach(), z) + grid.mse(total, z.detach())
            else:
                commitment = commitment + self._penalty(self.penalties, level, z - total, share, grid)
                total = total + share
            residual = residual - share.detach()
        if fed:
            self._learn_together(fed, ids, grid)
        # with affine levels the value's own gradient reaches W and b
        straight = total + (z - z.detach()) if self.affines else z + (total - z).detach()
        return TrainingQuantized(straight, commitment if self.penalties else commitment / len(ids), tuple(ids))

    def _learn_together(self, vectors: Sequence[Tensor], ids: Sequence[Tensor], grid: Grid) -> None:
        """One EMA step of the shared codebook on [B, s_n, D] of every level; motion by motion, so that codes restart
        from all levels."""
        masks = [grid.real(level) for level in range(len(ids))]
        real = None if masks[0] is None else torch.cat([mask for mask in masks if mask is not None], dim=1)
        self.codebooks[0].learn(_real(torch.cat(list(vectors), dim=1), real), _real(torch.cat(list(ids), dim=1), real))

    def _penalty(self, weights: Penalties, level: int, before: Tensor, share: Tensor, grid: Grid) -> Tensor:
        """C1's terms of one level, divided by OUTER so that a trainer's weight gives them theirs; scalar.

        The commitment is a mean over elements, as in the other systems; the others are squared Frobenius norms.
        """
        loss = weights.beta * grid.mse(before, share.detach())
        if self.affines:
            loss = loss + weights.gamma * self.affines[level].distance()
        if weights.decorrelation and level < len(self.scales) - 1:
            real = grid.real(None)
            covariance = cross_covariance(_real(share, real), _real(before - share, real))
            loss = loss + weights.decorrelation * covariance.square().sum()
        return loss / OUTER

    def _start(self, z: Tensor, grid: Grid) -> None:
        """Fill the codebooks from the first training batch, once (A6, init)."""
        if not self._known_started:
            if not bool(self.started):
                for book in dict.fromkeys(self.codebooks):
                    book.start(_real(z, grid.real(None)))
                self.started.fill_(True)
            self._known_started = True

    def _levels_used(self) -> int:
        """How many levels this training step uses: all, or the same random prefix on every process (B1)."""
        levels = len(self.scales)
        if not self.training or not self.level_drop:
            return levels
        coin, place = _from_first_process(torch.rand(2, device=self.started.device)).tolist()
        return levels if coin >= self.level_drop else 1 + int(place * levels)


def _real(x: Tensor, real: Tensor | None) -> Tensor:
    """The real ones of x [B, s, ...] one after the other [n, ...]; all without a mask."""
    return x.flatten(0, 1) if real is None else x[real]


def _choose(book: Codebook, vectors: Tensor, real: Tensor | None, noise: float = 0.0) -> Tensor:
    """Codes [B, s] of vectors [B, s, D]; 0 where none is real."""
    if real is None:
        return book.lookup(vectors, noise)
    ids = torch.zeros(real.shape, dtype=torch.int64, device=vectors.device)
    ids[real] = book.lookup(vectors[real], noise)
    return ids
