"""Work in portions, over one process or many: every process does its portions and fills its rows, the sums are shared.

The portions do not depend on the number of processes, and a row is filled by one process alone, so that the shared
arrays are the same numbers however many processes there are.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from playground.launch import Launch, launch_fabric, launched

if TYPE_CHECKING:
    import torch

Portion = TypeVar("Portion")


class Spread:
    """This process among those that share the work; alone by default."""

    def __init__(self, fabric: Any = None) -> None:
        self._fabric = fabric

    @property
    def first(self) -> bool:
        """Whether this is the process that reads, writes and speaks."""
        return self._fabric is None or bool(self._fabric.is_global_zero)

    @property
    def size(self) -> int:
        """Number of processes."""
        return 1 if self._fabric is None else int(self._fabric.world_size)

    @property
    def device(self) -> "torch.device":
        """Where this process computes: a GPU where there is one."""
        import torch

        if self._fabric is not None:
            return self._fabric.device
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")

    def mine(self, portions: Sequence[Portion]) -> list[Portion]:
        """The portions of this process."""
        if self._fabric is None:
            return list(portions)
        return list(portions[self._fabric.global_rank :: self.size])

    def total(self, array: NDArray[np.float64]) -> NDArray[np.float64]:
        """The sum over all processes, on every process; rows that a process did not fill are 0 there."""
        if self._fabric is None:
            return array
        import torch

        shared = self._fabric.all_reduce(torch.from_numpy(array).to(self.device), reduce_op="sum")
        return np.asarray(shared.cpu().numpy(), np.float64)

    def tell(self, number: int) -> int:
        """A number that the first process knows, on every process."""
        return int(self.total(np.array([float(number) if self.first else 0.0]))[0])


def join_spread() -> Spread:
    """The processes that torchrun started, or this one alone. Never mixed precision: what is measured is float32."""
    return Spread(launch_fabric(Launch(precision="32-true"))) if launched() else Spread()


class Tally:
    """Counts finished motions for a progress line."""

    def __init__(self, progress: Callable[[int, int], None] | None, total: int) -> None:
        self._progress = progress
        self._total = total
        self._done = 0

    def add(self, count: int) -> None:
        """So many more are done."""
        self._done += count
        if self._progress:
            self._progress(min(self._done, self._total), self._total)
