"""Somebody else's state dict: arrays taken by name, each once; what is missing or left over becomes a sentence."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from playground.errors import PlaygroundError


@dataclass(eq=False)
class ForeignState:
    """The arrays of one file by their foreign names."""

    path: Path
    arrays: dict[str, Tensor] = field(repr=False)

    @classmethod
    def checked(cls, path: Path, found: Mapping[str, Tensor]) -> "ForeignState":
        """PlaygroundError for arrays that claim more values than they bring, or values that are no finite numbers."""
        for name, value in found.items():
            plain = value.layout == torch.strided and not value.is_quantized and value.is_contiguous()
            if not plain or value.untyped_storage().nbytes() < value.numel() * value.element_size():
                raise PlaygroundError(f"{path} holds {str(name)[:80]} in a form that state dicts do not have")
            if not torch.isfinite(value).all():
                raise PlaygroundError(f"{path} holds values in {str(name)[:80]} that are no finite numbers")
        return cls(path, {str(name): value for name, value in found.items()})

    def take(self, name: str, axes: int | None = None) -> Tensor:
        """An array by name, float32, each once. PlaygroundError if it is not there, or of other axes or values."""
        if axes is not None:
            self.shape(name, axes)
        if name not in self.arrays:
            raise PlaygroundError(f"{self.path} lacks the array {name}, so it is not of the released kind")
        value = self.arrays.pop(name)
        if not value.dtype.is_floating_point:
            raise PlaygroundError(f"{self.path} holds {name} as {value.dtype}; real numbers are needed")
        return value.detach().float()

    def join(self, names: Sequence[str]) -> Tensor:
        """Arrays joined along their first axis. PlaygroundError where they do not fit together."""
        parts = [self.take(name) for name in names]
        if any(part.ndim == 0 or part.shape[1:] != parts[0].shape[1:] for part in parts):
            raise PlaygroundError(f"{self.path} holds {names[0]} and {names[-1]} in shapes that do not fit together")
        return torch.cat(parts)

    def shape(self, name: str, axes: int) -> tuple[int, ...]:
        """Shape of an array, which stays. PlaygroundError if it is not there, is empty or has other axes."""
        found = tuple(self.arrays[name].shape) if name in self.arrays else ()
        if len(found) != axes or 0 in found:
            raise PlaygroundError(
                f"{self.path} lacks the array {name} of {axes} axes, so it is not of the released kind"
            )
        return found

    def count(self, prefix: str) -> int:
        """How many numbered modules stand below a prefix."""
        pattern = re.compile(rf"{re.escape(prefix)}\.(\d{{1,4}})\.")
        return len({match.group(1) for name in self.arrays if (match := pattern.match(name))})

    def drop(self, pattern: str) -> None:
        """Leave out arrays that mean nothing here: frozen encoders, tables that are computed, state of a training."""
        self.arrays = {name: value for name, value in self.arrays.items() if not re.search(pattern, name)}

    def check_empty(self) -> None:
        """PlaygroundError if arrays are left that nothing asked for."""
        if self.arrays:
            raise PlaygroundError(
                f"{self.path} holds {len(self.arrays)} arrays that the released model has not, among them"
                f" {min(self.arrays)[:80]}"
            )

    def check_shapes(self, wanted: Mapping[str, Tensor], given: Mapping[str, Tensor]) -> None:
        """PlaygroundError unless the arrays made from this file are those that a model needs."""
        for name, value in given.items():
            if name not in wanted or wanted[name].shape != value.shape:
                needed = list(wanted[name].shape) if name in wanted else "none"
                raise PlaygroundError(f"{self.path} gives {name} the shape {list(value.shape)}; {needed} is needed")
