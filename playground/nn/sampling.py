"""Drawing codes from logits: guidance, top-k share, nucleus, temperature. Randomness is an argument."""

from collections.abc import Callable
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


def draw(logits: Tensor, sampling: Sampling, rng: torch.Generator) -> Tensor:
    """Codes [B, s] from guided logits [B, s, V]. The draw happens on the CPU, so a seed means the same everywhere."""
    if sampling.temperature <= 0:
        return logits.argmax(dim=-1)
    kept = filter_logits(logits.float().cpu() / sampling.temperature, sampling.top_k, sampling.top_p)
    flat = kept.softmax(dim=-1).flatten(0, -2)
    return torch.multinomial(flat, 1, generator=rng).view(logits.shape[:-1]).to(logits.device)


def entropy_bits(logits: Tensor) -> Tensor:
    """Entropy [B, s] in bits of the distributions given by logits [B, s, V]."""
    log = logits.float().log_softmax(dim=-1)
    return -(log.exp() * log).sum(dim=-1) / torch.log(torch.tensor(2.0))
