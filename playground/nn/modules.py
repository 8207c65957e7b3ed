"""Module lists with a type."""

from collections.abc import Iterable
from typing import TypeVar, cast

from torch import nn

M = TypeVar("M", bound=nn.Module)


def module_list(items: Iterable[M]) -> list[M]:
    """An `nn.ModuleList` that type checkers see as a list of its items' class."""
    return cast("list[M]", nn.ModuleList(items))
