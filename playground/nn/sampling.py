"""Drawing codes from logits: guidance, top-k share, nucleus, temperature, Gumbel. Randomness is an argument."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class Sampling:
    """How tokens are drawn (A10); `check` is called between scales and may raise to stop."""

    seed: int = 0
    cfg: float = 4.0  # guidance of the generator, reached at the last scale
    temperature: float = 1.0  # 0 takes the most likely code
    top_k: float = 0.2  # share of the codes kept
    top_p: float = 0.95  # nucleus on what is left
    check: Callable[[], None] | None = None
    seeds: tuple[int, ...] = ()  # one a row, in place of `seed`: each row draws as a batch of one with its seed does

    def rng(self) -> torch.Generator | list[torch.Generator]:
        """Fresh sources of randomness: one for the batch, or one a row where `seeds` are given."""
        if self.seeds:
            return [torch.Generator().manual_seed(seed) for seed in self.seeds]
        return torch.Generator().manual_seed(self.seed)


def guide(conditional: Tensor, unconditional: Tensor, scale: float) -> Tensor:
    """(1 + t) cond - t uncond."""
    return (1 + scale) * conditional - scale * unconditional


def filter_logits(logits: Tensor, top_k: float, top_p: float) -> Tensor:
    """Set all but the largest int(V * top_k) logits (at least one), then all outside the nucleus, to -inf; [..., V]."""
    size = logits.shape[-1]
    keep = max(1, min(size, int(size * top_k + 1e-9)))
    ordered, index = logits.sort(dim=-1, descending=True, stable=True)
    rank = torch.arange(size, device=logits.device)
    ordered = ordered.masked_fill(rank >= keep, float("-inf"))
    chance = ordered.softmax(dim=-1)
    before = chance.cumsum(dim=-1) - chance  # mass of everything more likely
    ordered = ordered.masked_fill((before >= top_p) & (rank > 0), float("-inf"))
    return torch.empty_like(logits).scatter_(-1, index, ordered)


def draw(logits: Tensor, sampling: Sampling, rng: torch.Generator | Sequence[torch.Generator]) -> Tensor:
    """Codes [B, s] from guided logits [B, s, V], with one rng or one a row.

    The draw happens on the CPU, so a seed means the same everywhere.
    """
    if sampling.temperature <= 0:
        return logits.argmax(dim=-1)
    kept = filter_logits(logits.float().cpu() / sampling.temperature, sampling.top_k, sampling.top_p)
    chance = kept.softmax(dim=-1)
    if isinstance(rng, torch.Generator):
        ids = torch.multinomial(chance.flatten(0, -2), 1, generator=rng).view(logits.shape[:-1])
    else:
        rows = zip(chance, rng, strict=True)
        ids = torch.stack([torch.multinomial(row, 1, generator=one)[:, 0] for row, one in rows])
    return ids.to(logits.device)


def entropy_bits(logits: Tensor) -> Tensor:
    """Entropy [B, s] in bits of the distributions given by logits [B, s, V]."""
    log = logits.float().log_softmax(dim=-1)
    return -(log.exp() * log).sum(dim=-1) / torch.log(torch.tensor(2.0))


def top_share(logits: Tensor, share: float) -> Tensor:
    """Set all but the largest ceil(V * share) logits (at least one) to -inf; [..., V] (MoMask, B2)."""
    size = logits.shape[-1]
    count = max(1, min(size, math.ceil(size * share - 1e-9)))
    best = logits.topk(count, dim=-1)
    return torch.full_like(logits, float("-inf")).scatter_(-1, best.indices, best.values)


def gumbel_draw(
    logits: Tensor,
    temperature: float,
    rng: torch.Generator | Sequence[torch.Generator],
    real: Tensor | None = None,
) -> Tensor:
    """Codes [B, s]: arg max of logits [B, s, V] / temperature plus Gumbel noise; the plain arg max at temperature 0.

    With one rng or one a row. real (bool [B, s]): noise is drawn for these positions alone, so that padding changes no
    draw. On the CPU, so a seed means the same everywhere.
    """
    if temperature <= 0:
        return logits.argmax(dim=-1)
    rows = [rng] * len(logits) if isinstance(rng, torch.Generator) else rng
    score = logits.float().cpu() / temperature
    for row, one in zip(range(len(score)), rows, strict=True):
        here = torch.ones(score.shape[1], dtype=torch.bool) if real is None else real[row].cpu()
        chance = torch.rand(int(here.sum()), score.shape[2], generator=one).clamp(min=1e-12)
        score[row, here] -= (-chance.log()).log()
    return score.argmax(dim=-1).to(logits.device)


def confidence(logits: Tensor, ids: Tensor) -> Tensor:
    """Probability [B, s] of codes [B, s] under unfiltered logits [B, s, V] at temperature 1."""
    return logits.float().softmax(dim=-1).gather(-1, ids[..., None])[..., 0]
