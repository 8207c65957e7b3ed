"""The engine as everybody calls it: what `base.py` loads and runs, and the studies of this folder's other modules."""

import time
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.engine import alignment, codes, language, microscope, placement, refining, regeneration, scales
from playground.engine.base import BaseEngine
from playground.engine.checks import (
    UNIT,
    check_code,
    check_guidance,
    check_sampling,
    deadline_check,
    settings,
    whole,
)
from playground.engine.editing import EditRequest, benchmark_span, edit, edited_frames
from playground.engine.endless import EndlessSession
from playground.engine.generation import finish
from playground.errors import PlaygroundError
from playground.findings import (
    Alignment,
    Alternatives,
    Attention,
    Edited,
    Language,
    Neighbours,
    Occurrence,
    Placed,
    ScaleSet,
    ScaleStudy,
    Swap,
)
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.results import Decoded, Generation, GenerationStep, Tokenized
from playground.stored import StoredAnalysis
from playground.systems import DEFAULT_SYSTEM, row_of
from playground.text.prompts import normalise

if TYPE_CHECKING:
    from playground.runtime import Runtime

Result = Tokenized | Generation
DEADLINE = LIMITS.deadline_seconds


class Engine(BaseEngine):
    """Loads each system once and answers from any thread; holds no state of a call.

    Scales count from 1, positions of tokens, codes and frames from 0. Every call raises PlaygroundError, in one
    sentence, for a place, code or number that is not there and for a run past its deadline.
    """

    # ---- scales and codes ----------------------------------------------------------------------------------------

    def scale_study(
        self,
        tokenized: Tokenized,
        guidance: float = 0.0,
        kind: str = "upto",
        deadline: float | None = DEADLINE,
    ) -> ScaleStudy:
        """The motion decoded from scales 1 to n for every n, with its error and the energy left.

        kind: "upto", or every scale alone ("only") or all but one ("without"). One decode of `reconstruct` each.
        """
        check_guidance(guidance)
        runtime = self.runtime(tokenized.system)
        sets = scales.scale_sets(kind, len(tokenized.levels))
        return scales.study_scales(runtime, tokenized, sets, guidance, deadline_check(deadline))

    def neighbours(self, system: str, scale: int, code: int, count: int = 8) -> Neighbours:
        """The codes most like a code of a scale, by the angle between their vectors, and the one least like it."""
        self._check_code(system, scale, code)
        listed = whole(count, "the number of neighbours", 1, LIMITS.max_listed)
        return codes.nearest(self.codebooks(system)[scale - 1], system, scale, code, listed)

    def occurrences(self, system: str, scale: int, code: int, count: int = 8) -> list[Occurrence]:
        """Where a code stands in the example library and in the clips of the stored analysis; [] if nowhere."""
        self._check_code(system, scale, code)
        listed = whole(count, "the number of occurrences", 1, LIMITS.max_listed)
        analysis = codes.open_analysis(self.assets / "analysis", system)
        checkpoint = self.runtime(system).checkpoint
        return codes.find(analysis, self._stored_examples(), system, checkpoint, scale, code, listed)

    def prototype(self, system: str, scale: int, code: int, seconds: float = 2.0) -> Decoded:
        """The motion a code stands for: its scale alone, filled with it, decoded without text."""
        self._check_code(system, scale, code)
        if not LIMITS.min_seconds <= seconds <= LIMITS.max_seconds:
            raise PlaygroundError(f"{seconds:g} seconds; {LIMITS.min_seconds:g} to {LIMITS.max_seconds:g} are accepted")
        frames = int(LIMITS.fps * seconds + 1e-6) // UNIT * UNIT
        return codes.prototype(self.runtime(system), scale, code, frames)

    # ---- the token microscope -------------------------------------------------------------------------------------

    def swap(self, result: Result, scale: int, position: int, code: int | str, guidance: float = 0.0) -> Swap:
        """One token replaced by a code (its number, "nearest" or "opposite"), and where the motion changes."""
        check_guidance(guidance)
        return microscope.swap(self._with_tokens(result), result, scale, position, code, guidance)

    def governed(
        self, result: Result, scale: int, guidance: float = 0.0, deadline: float | None = DEADLINE
    ) -> NDArray[np.int64]:
        """Measured spans [s, 2] of all tokens of a scale: the frames (start, stop) that hold 80 % of the energy of the
        change when the token alone is replaced by its code's opposite; (0, 0) where nothing changes."""
        check_guidance(guidance)
        return microscope.governed(self._with_tokens(result), result, scale, guidance, deadline_check(deadline))

    # ---- language --------------------------------------------------------------------------------------------------

    def language(self, tokenized: Tokenized, wrong: str, deadline: float | None = DEADLINE) -> Language:
        """The motion tokenized with its own caption, without one and with a wrong one; which tokens flip."""
        wrong = normalise(wrong, what="wrong caption")
        return language.compare_captions(self.runtime(tokenized.system), tokenized, wrong, deadline_check(deadline))

    def attention(self, result: Result, caption: str | None = None) -> Attention:
        """Cross-attention of the detokenizer: words by frames. caption None: the one that the tokens go with."""
        text = normalise(result.caption if caption is None else caption, what="caption", allow_empty=True)
        return language.words_by_frames(self._with_tokens(result), result, text)

    def reads_words(self, system: str) -> bool:
        """Whether a system's detokenizer reads the caption, which is where guidance acts; loads no weight."""
        reads = row_of(system).tokenizer is not None and self._config(system).get("text_side")
        return reads in ("both", "detokenizer")

    def looks_at_words(self, system: str) -> bool:
        """Whether `alignment` has something to tell of a system's motions; loads no weight."""
        return alignment.can_look(self.assets, row_of(system))

    def alignment(self, made: Generation, deadline: float | None = DEADLINE) -> Alignment:
        """Which words each frame looked at while a motion was drawn, [F, W]: the generator's attention (CASIM), else
        the detokenizer's. PlaygroundError for a motion without a prompt or a system that looks at no single words."""
        return alignment.words_by_time(self.runtime(made.system), made, deadline_check(deadline))

    # ---- alternatives and regeneration ----------------------------------------------------------------------------

    def alternatives(
        self, result: Result, scale: int, position: int, count: int = 8, deadline: float | None = DEADLINE
    ) -> Alternatives:
        """What else a token could have been: the generator's most probable codes, given the coarser scales."""
        listed = whole(count, "the number of alternatives", 1, LIMITS.max_listed)
        how = result.sampling if isinstance(result, Generation) else row_of(result.system).sampling
        runtime = self._with_tokens(result)
        return regeneration.alternatives(runtime, result, how, scale, position, listed, deadline_check(deadline))

    def regenerate_steps(
        self,
        generation: Generation,
        scale: int,
        position: int | None = None,
        code: int | None = None,
        seed: int | None = None,
        deadline: float | None = DEADLINE,
        previews: bool = True,
    ) -> Iterator[GenerationStep]:
        """Draw a generation anew from a scale on; scales before it stay, and a token at (scale, position) is forced.

        With its own seed (None) everything that does not depend on the forced token comes out as before, the other
        tokens of that scale included; another seed draws all of it anew. Sampling is the generation's own.
        """
        chosen = generation.seed if seed is None else seed
        check_sampling(chosen, **vars(generation.sampling))
        runtime, check = self._with_tokens(generation), deadline_check(deadline)
        yield from regeneration.regenerate_steps(runtime, generation, scale, position, code, chosen, check, previews)

    def regenerate(
        self,
        generation: Generation,
        scale: int,
        position: int | None = None,
        code: int | None = None,
        seed: int | None = None,
        deadline: float | None = DEADLINE,
    ) -> Generation:
        """The finished motion of `regenerate_steps`."""
        began = time.perf_counter()
        (last,) = self.regenerate_steps(generation, scale, position, code, seed, deadline, previews=False)
        chosen = generation.seed if seed is None else seed
        return finish(self.runtime(generation.system), last, chosen, generation.sampling, began)

    def endless(
        self, prompt: str, system: str = "mogo", seed: int = 0, carry: int | None = None, **options: Any
    ) -> EndlessSession:
        """A motion without end: `session.advance(seconds)` goes on, `session.say(prompt)` changes the instruction.

        carry: time steps of the past that stay in sight at a switch (None: all that are held). options: cfg,
        temperature, top_k, top_p. PlaygroundError also for a system that cannot draw step by step.
        """
        how = settings(row_of(system), options)
        check_sampling(seed, **vars(how))
        return EndlessSession(self.runtime(system), prompt, seed, how, carry)

    # ---- editing ---------------------------------------------------------------------------------------------------

    def edit(
        self,
        source: Motion | Result,
        span: Sequence[int] | None,
        prompt: str | None,
        seed: int = 0,
        kind: str = "inpaint",
        system: str = DEFAULT_SYSTEM,
        caption: str | None = None,
        anchor: str = "place",
        measured: bool = False,
        deadline: float | None = DEADLINE,
        **options: Any,
    ) -> Edited:
        """Frames drawn anew after a prompt (None: free-form), the others kept as they are.

        span: (start, stop) in frames; None takes that of the published benchmark. kind says what is drawn: the span
        ("inpaint"), all but the span ("outpaint"), everything from its start on ("prefix": what comes before is kept),
        everything up to its end ("suffix"), or the span with nothing of its old frames left ("inbetween").
        anchor "place" keeps every kept frame exactly where it was, and the drawn frames share out the way that is
        missing to it; "body" moves the kept frames that follow on the floor as one piece instead. measured: tokens are
        drawn anew by the frames that they were measured to govern. A Motion is tokenized with `system` and `caption`
        first. options: guidance, cfg, temperature, top_k, top_p.
        """
        text = None if prompt is None else normalise(prompt)
        row = row_of(system if isinstance(source, Motion) else source.system)
        how, check = settings(row, options), deadline_check(deadline)
        check_sampling(seed, **vars(how))
        if isinstance(source, Motion):
            source = self.tokenize(source, source.caption if caption is None else caption, system)
        chosen = benchmark_span(kind, source.motion.frames) if span is None else span
        edited_frames(kind, chosen, source.motion.frames)
        start, stop = chosen
        request = EditRequest(kind, (int(start), int(stop)), text, seed, how, anchor, measured)
        return edit(self._with_tokens(source), source, request, check)

    # ---- the root refiner ------------------------------------------------------------------------------------------

    @property
    def refines(self) -> bool:
        """Whether a root refiner is shipped; loads no weight."""
        return refining.refiner_path(self.assets).is_file()

    def refiner(self) -> refining.Refiner:
        """The shipped root refiner. PlaygroundError where there is none."""
        return refining.open_refiner(self.assets)

    def refine(self, generation: Generation) -> Generation:
        """The same body movement and the same tokens, with the way over the ground computed anew from that movement,
        so that standing feet slide less. PlaygroundError where no root refiner is shipped."""
        return refining.refine(self.refiner(), self.runtime(generation.system), generation)

    # ---- maps ------------------------------------------------------------------------------------------------------

    def place(self, result: Result, system: str | None = None, each: str = "clip") -> Placed:
        """Where a motion ("clip"), or each of its tokens ("token"), belongs in the stored maps of its system.

        For another system a tokenized motion is tokenized with that system first.
        """
        if each not in ("clip", "token"):
            raise PlaygroundError(f"maps are of each {str(each)[:40]!r}; clip or token is accepted")
        wanted = result.system if system is None else row_of(system).name
        if wanted != result.system:
            result = self.tokenize(result.motion, result.caption, wanted)
        analysis = self.analysis(wanted)
        how = placement.place_clip if each == "clip" else placement.place_tokens
        return how(self.runtime(wanted), result, analysis)

    def analysis(self, system: str) -> StoredAnalysis:
        """The stored analysis of a system: maps, counts, tokens of test clips. PlaygroundError where there is none."""
        found = codes.open_analysis(self.assets / "analysis", row_of(system).name)
        return found if found is not None else StoredAnalysis.read(self.assets / "analysis", system)

    def _with_tokens(self, result: Result) -> "Runtime":
        """The loaded models of a result's system. PlaygroundError if it has no tokens."""
        runtime = self.runtime(result.system)
        if runtime.codec is None:
            raise PlaygroundError(row_of(result.system).no_tokenizer)
        return runtime

    def _check_code(self, system: str, scale: int, code: int) -> None:
        sizes = self.scales(system)
        if not sizes:
            raise PlaygroundError(row_of(system).no_tokenizer)
        level = whole(scale, "the scale", 1, len(sizes)) - 1
        check_code(sizes[level][1], scale, code)


@lru_cache(maxsize=1)
def default_engine() -> Engine:
    """The engine on the repository's own assets, one a process."""
    return Engine()


__all__ = ["Engine", "ScaleSet", "default_engine"]
