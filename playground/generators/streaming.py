"""Motion without end: tokens drawn from MOGO's generator as they are asked for, decoded in overlapping windows (C3).

Both halves hold a bounded past, whatever was drawn before. What leaves a window is never changed afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from playground.generators.hierarchical import HierarchicalGenerator, Sweep
from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokenizer, Tokens


class Stream:
    """Tokens of one endless motion (or of a batch), a few time steps at a time; the text may change at any step.

    What is drawn is a function of the seed and of the steps at which the text changed, not of how many steps are asked
    for at once. `drawn` counts the time steps so far.
    """

    def __init__(
        self, generator: HierarchicalGenerator, text: TextFeatures | None, sampling: Sampling, rows: int = 1
    ) -> None:
        """text: features of `rows` prompts; None draws free-form. sampling.check is called before every step."""
        self.generator = generator
        self.sampling = sampling
        self.rows = rows
        self.drawn = 0
        self._rng = sampling.rng()
        self._ready: list[Tensor] = []  # steps that were drawn and not given out, [N, B] each
        self._sweep = self._begin(text, None)

    @torch.no_grad()
    def _begin(self, text: TextFeatures | None, history: Sequence[Tensor] | None) -> Sweep:
        return Sweep(self.generator.network, text, self.rows, self.sampling.cfg, history)

    def switch(self, text: TextFeatures | None, carry: int | None = None) -> None:
        """Another text from the next step on; the caches are built anew, what was drawn stays.

        carry: newest steps that stay in sight under the new text (default: all that are held).
        """
        history = self._sweep.history
        if carry is not None:
            history = [ids[:, ids.shape[1] - min(carry, ids.shape[1]) :].clone() for ids in history]
        self._sweep = self._begin(text, history)

    @torch.no_grad()
    def next(self, steps: int, check: Callable[[], None] | None = None) -> tuple[Tensor, ...]:
        """The next time steps: ids [B, steps] of all levels. check: called before every step, may raise.

        What was drawn before a check raised is not lost: the next call begins with it.
        """
        while len(self._ready) < steps:
            for stop in (check, self.sampling.check):
                if stop is not None:
                    stop()
            ids, _ = self._sweep.step(self.sampling, self._rng)
            self._ready.append(torch.stack(ids))
            self.drawn += 1
        taken, self._ready = self._ready[:steps], self._ready[steps:]
        if not taken:
            return tuple(ids[:, :0] for ids in self._sweep.history)
        return tuple(torch.stack(taken, dim=-1))

    def held(self) -> int:
        """Bytes of the past that is held: tokens, keys and values."""
        tables = [table for cache in self._sweep.caches for table in (cache.keys, cache.values)]
        return storage_bytes([*self._sweep.history, *(part for table in tables for part in table.values())])


@dataclass(frozen=True)
class Overlap:
    """How windows overlap, in time steps: `before` and `after` a step are decoded with it, windows fade over `fade`.

    Where a decoder sees no farther than `before` to the left and after - fade to the right, the result is that of one
    decode of everything.
    """

    before: int = 24
    after: int = 4
    fade: int = 1


class WindowDecoder:
    """Tokens that keep coming -> feature rows that keep coming, for a tokenizer whose steps stand for frames.

    Rows are given out once `after` further steps are known; the first rows of a window fade over from what the window
    before it made of them.
    """

    def __init__(self, tokenizer: Tokenizer, overlap: Overlap = Overlap()) -> None:
        """ValueError unless 0 <= fade <= after and before >= 1."""
        if not (0 <= overlap.fade <= overlap.after and overlap.before >= 1):
            raise ValueError(f"windows cannot overlap like this: {overlap}")
        self.tokenizer = tokenizer
        self.overlap = overlap
        config = tokenizer.config
        self.unit = -(-config.max_frames // config.scales[0])  # frames a step
        self._ids: list[Tensor] = []  # newest steps, [B, before + after] a level
        self._waiting = 0  # how many of them have not been given out
        self._rows: Tensor | None = None  # what the last window made of the first `fade` steps that wait

    def push(self, ids: Sequence[Tensor]) -> Tensor:
        """Ids [B, n] of all levels, the next n steps -> the rows [B, R, C] that are finished now, normalised."""
        return self._decode(ids, self.overlap.after)

    def finish(self) -> Tensor:
        """The rows [B, R, C] that still wait; afterwards the decoder goes on as if nothing had come after them."""
        return self._decode([ids[:, :0] for ids in self._ids], 0)

    @torch.no_grad()
    def _decode(self, ids: Sequence[Tensor], keep: int) -> Tensor:
        """Decode the window; of the steps that wait all but the newest `keep` are given out."""
        joined = [torch.cat([old, new], dim=1) for old, new in zip(self._ids, ids, strict=True)] if self._ids else ids
        size, columns = joined[0].shape[1], self.tokenizer.config.columns
        waiting = self._waiting + ids[0].shape[1]
        given = max(0, waiting - keep)
        out = torch.zeros(len(joined[0]), 0, columns, device=joined[0].device)
        if given:
            tokens = Tokens(tuple(joined), self.tokenizer.quantizer.codes)
            lengths = torch.full((len(joined[0]),), size * self.unit, device=joined[0].device)
            rows = self.tokenizer.decode(self.tokenizer.embed(tokens, lengths=lengths), lengths, None)
            rows = self._faded(rows[:, (size - waiting) * self.unit :])
            out = rows[:, : given * self.unit]
            self._rows = rows[:, given * self.unit : (given + self.overlap.fade) * self.unit].clone()
        self._waiting = waiting - given
        newest = size - min(size, self.overlap.before + self._waiting)
        self._ids = [level[:, newest:].clone() for level in joined]
        return out

    def _faded(self, rows: Tensor) -> Tensor:
        """Rows [B, R, C], the first of them leaning towards those of the window before."""
        count = 0 if self._rows is None else min(self._rows.shape[1], rows.shape[1])
        if not count or self._rows is None:
            return rows
        share = (torch.arange(count, device=rows.device) + 1)[:, None] / (count + 1)
        return torch.cat([torch.lerp(self._rows[:, :count], rows[:, :count], share), rows[:, count:]], dim=1)

    def held(self) -> int:
        """Bytes of the past that is held."""
        return storage_bytes(self._ids if self._rows is None else [*self._ids, self._rows])


def storage_bytes(tensors: Sequence[Tensor]) -> int:
    """Bytes behind the tensors, each storage counted once."""
    stores = {part.untyped_storage().data_ptr(): part.untyped_storage().nbytes() for part in tensors}
    return sum(stores.values())
