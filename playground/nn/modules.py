"""Module lists with a type, and a table of learned word vectors."""

from collections.abc import Iterable
from typing import TypeVar, cast

from torch import Tensor, nn

M = TypeVar("M", bound=nn.Module)


def module_list(items: Iterable[M]) -> list[M]:
    """An `nn.ModuleList` that type checkers see as a list of its items' class."""
    return cast("list[M]", nn.ModuleList(items))


class WordTable(nn.Module):
    """A learned vector a word, for text encoders that give word numbers instead of states (LG-Tok, Table 4f)."""

    def __init__(self, words: int, width: int) -> None:
        super().__init__()
        self.vectors = nn.Embedding(words, width)
        nn.init.normal_(self.vectors.weight, std=width**-0.5)

    def forward(self, numbers: Tensor) -> Tensor:
        """numbers [B, W, 1], whole and below `words` -> vectors [B, W, D]."""
        states: Tensor = self.vectors(numbers[..., 0].long())
        return states
