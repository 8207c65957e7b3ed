"""The closer looks of the room Tokenize: one token under the microscope, and what the words do. Its handlers."""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import gradio as gr
import numpy as np

from playground.errors import PlaygroundError
from playground.ui.services import Services
from playground.ui.tokencard import token_card
from playground.ui.tokenizing import Findings, Session, open_session, ready, stage_of, system_of
from playground.ui.view import View
from playground.ui.wordcard import words_card

if TYPE_CHECKING:
    from playground.analysis.bundle import Bundle
    from playground.findings import Neighbours

NO_TOKEN = "choose a token of the score first"


class Closer:
    """Each gives session, stage, token card, words card, and for the address the code put in and the wrong words."""

    def __init__(self, services: Services, opening: View) -> None:
        self.services = services
        self.opening = opening

    # ---- one token ------------------------------------------------------------------------------------------------

    def select(self, held: Session | None, event: gr.EventData) -> Iterator[tuple[Any, ...]]:
        """A token of the score, or None: its card at once, then the frames that its scale's tokens govern."""
        held = self._open(held)
        chosen = event.selection
        if not chosen:
            yield self.close(replace(held, token=None))
            return
        self._check_whose(held, chosen)
        level, position = self._place(held, chosen)
        if held.token == (level, position) and held.found.swap is not None:
            yield self._told(held)
            return
        wish, held = held.wish, replace(held, token=(level, position), wish=None)
        held.found.swap = held.found.language = None
        if wish is not None:
            self._swap(held, wish)
        if level not in held.found.spans:
            yield self._told(held)
            assert held.tokenized is not None
            held.found.spans[level] = self.services.engine().governed(held.tokenized, level)
        yield self._told(held)

    def act(self, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """A button of the token card: another code, or the old one again."""
        held = self._open(held)
        if held.token is None:
            raise PlaygroundError(NO_TOKEN)
        if event.do == "undo":
            held.found.swap = None
        else:
            self._swap(held, self._code(held, str(event.do), str(event.code), str(event.number)))
        return self._told(held)

    def _check_whose(self, held: Session, chosen: Any) -> None:
        """PlaygroundError for a token of a system that stands beside the first one."""
        first = system_of(self.services, held)
        if chosen.get("system", first.name) in held.beside and chosen["system"] != first.name:
            whose = self.services.system(str(chosen["system"])).title
            raise PlaygroundError(f"this is a token of {whose}; choose {whose} under System to take its tokens apart")

    def _place(self, held: Session, chosen: Any) -> tuple[int, int]:
        try:
            level, position = int(chosen["scale"]), int(chosen["position"])
        except (KeyError, TypeError, ValueError) as error:
            raise PlaygroundError(NO_TOKEN) from error
        assert held.tokenized is not None
        levels = held.tokenized.levels
        if not 1 <= level <= len(levels) or not 0 <= position < levels[level - 1].size:
            raise PlaygroundError(NO_TOKEN)
        return level, position

    def _code(self, held: Session, do: str, code: str, number: str) -> int:
        """The code that a button stands for; the engine checks its range."""
        assert held.tokenized is not None and held.token is not None
        scale, position = held.token
        tokens = held.tokenized.levels[scale - 1]
        if do == "random":
            other = int(np.random.default_rng().integers(tokens.codes - 1))  # a new one at every click
            return other + (other >= int(tokens.ids[position]))
        text = number if do == "number" else code
        if not (text.isascii() and text.isdigit() and len(text) < 6):
            raise PlaygroundError(f"write the number of a code of scale {scale}, 0 to {tokens.codes - 1}")
        return int(text)

    def _swap(self, held: Session, code: int) -> None:
        assert held.tokenized is not None and held.token is not None
        held.found.language = None
        held.found.swap = self.services.engine().swap(held.tokenized, *held.token, code)

    # ---- words ----------------------------------------------------------------------------------------------------

    def words(self, wrong: str, held: Session | None) -> tuple[Any, ...]:
        """With the caption, without, with a wrong one; also what stands in the field of the wrong one now."""
        held = self._open(held)
        assert held.tokenized is not None
        wrong = wrong.strip() or self.another(held.tokenized.caption)
        engine, tokenized = self.services.engine(), held.tokenized
        held.found.language = engine.language(tokenized, wrong)
        try:
            held.found.attention = engine.attention(tokenized)
        except PlaygroundError:  # a system that reads no words while it decodes
            held.found.attention = None
        held = replace(held, token=None)
        held.found.swap = None
        return *self._told(held), wrong

    def mark(self, which: str, held: Session | None) -> tuple[Any, ...]:
        """Which flips the score marks."""
        if which not in ("bare", "misled"):
            raise PlaygroundError("tokens are marked that change without words or with the wrong ones")
        held = self._open(held)
        held.found.marked = which
        return self._told(held)

    def close(self, held: Session | None) -> tuple[Any, ...]:
        """Back to the motion and what its tokens give back."""
        held = replace(self._open(held), token=None)
        held.found.swap = held.found.language = None
        return self._told(held)

    def another(self, caption: str) -> str:
        """A caption that says something else: of the examples the one that shares the fewest words with it."""
        own = set(caption.split())
        others = [example.caption for example in self.services.examples() if example.caption != caption]
        return min(others, key=lambda other: len(own & set(other.split())), default="a person sits down")

    # ---- inside ---------------------------------------------------------------------------------------------------

    def _open(self, held: Session | None) -> Session:
        return ready(self.services, open_session(self.services, held, self.opening))

    def _told(self, held: Session) -> tuple[Any, ...]:
        found = held.found
        view = View(stage=stage_of(self.services, held), seconds=_took(found))
        system = system_of(self.services, held)
        words = words_card(found.language, system.title, found.attention is not None) if found.language else ""
        card = self._card(held) if held.token is not None else ""
        code = str(found.swap.code) if found.swap else ""
        return held, view.stage_json(), card, words, code, found.language.wrong if found.language else ""

    def _card(self, held: Session) -> str:
        assert held.tokenized is not None and held.token is not None
        (scale, position), system = held.token, system_of(self.services, held).name
        tokens = held.tokenized.levels[scale - 1]
        code = int(tokens.ids[position])
        spans, frames = held.found.spans.get(scale), held.tokenized.motion.frames
        return token_card(
            system, scale, position, tokens.size, code, frames, self._like(system, scale, code),
            self.services.palettes(system)[scale - 1], None if spans is None else spans[position].tolist(),
            held.found.swap, self._bundle(system),
        )  # fmt: skip

    def _like(self, system: str, scale: int, code: int) -> "Neighbours | None":
        try:
            return self.services.engine().neighbours(system, scale, code)
        except PlaygroundError:  # a codebook of one code
            return None

    def _bundle(self, system: str) -> "Bundle | None":
        try:
            return self.services.bundle(system)
        except PlaygroundError:
            return None


def _took(found: Findings) -> float:
    """Seconds of the look on the stage, for its badge."""
    for one in (found.swap, found.language):
        if one is not None:
            return one.seconds
    return max((one.seconds for one in found.studies.values()), default=0.0)
