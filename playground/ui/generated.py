"""What the room Generate shows: one or several motions with the score of one of them, a token's card, the visit."""

import html
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from playground.figures import stage as scene
from playground.results import Generation, GenerationStep
from playground.ui.cards import term
from playground.ui.drawing import Drawing, Result, Visit, Wish, made_name
from playground.ui.facts import Fact, as_sentence, significant
from playground.ui.scenes import score, token_facts, words_strip
from playground.ui.services import Services
from playground.ui.shelf import Entry, shelf
from playground.ui.state import State, query
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.findings import Alignment, Alternatives

CHANGED = "another code than before"
NO_TOKENS = "This system makes a motion from noise and words, step by step. It writes no tokens, so there is no score."
LOOKED = {  # how the engine's word for an attention begins -> the map's name, and what it shows
    "detokenizer": ("the detokenizer looks at", "where the detokenizer looks while it turns tokens into frames"),
    "last layer of the denoiser": (
        "the denoiser looks at", "where the denoiser looks while it makes the motion from noise"),
    "last layer of the generator": (
        "the generator looks at", "where the generator looks when it chooses each token"),
}  # fmt: skip
BEFORE = "before"
Made = GenerationStep | Generation


def words_card(looked: "Alignment | None", why: str = "") -> str:
    """What the map under the score shows, and of which attention; or why there is none. "" for neither."""
    if looked is None:
        return f'<p class="mtp-aside">{html.escape(as_sentence(why))}</p>' if why else ""
    steps = f", on average over {len(looked.by_step)} steps" if len(looked.by_step) > 1 else ""
    return (
        f'<p class="mtp-aside">The map under the score shows {_kind(looked)[1]}{steps}. A column is a moment, the line '
        "is the playhead. Marks such as (begin) take what no word needs.</p>"
    )


def with_words(view: View, looked: "Alignment | None", result: Result, take: int) -> View:
    """The same result with the map of words by frames under its score, where there is one: that of one motion."""
    if looked is None:
        return view
    whose = f", seed {result.takes[take].seed}" if len(result.takes) > 1 else ""
    strip = words_strip(f"Which words {_kind(looked)[0]}{whose}", looked.words, looked.weights)
    return replace(view, stage={**view.stage, "strips": [strip]})


def _kind(looked: "Alignment") -> tuple[str, str]:
    return next(told for start, told in LOOKED.items() if looked.what.startswith(start))


def drawing_view(services: Services, drawing: Drawing, take: int = 0) -> View:
    """A run on its way, or at its end; `take` is the motion whose tokens the score shows."""
    made = drawing.steps if drawing.result is None else drawing.result.takes
    return _view(services, made, drawing.wish, drawing.before, take, drawing.seconds)


def result_view(services: Services, result: Result, take: int = 0) -> View:
    """A finished result."""
    return _view(services, result.takes, result.wish, result.before, take, result.takes[0].seconds)


def _view(
    services: Services, made: Sequence[Made], wish: Wish, before: Generation | None, take: int, seconds: float
) -> View:
    system, take = services.system(wish.system), min(take, len(made) - 1)
    shown, names = made[take], [f"Seed {seed}" for seed in wish.seeds]
    if len(made) == 1:
        names = ["After" if before else "Generated"]
    sizes = services.sizes(system.name, shown.motion.frames)
    level, count, unit, several = len(shown.levels), len(sizes), "scale" if sizes else "step", len(made) > 1
    if isinstance(shown, GenerationStep) and not sizes:
        level, count = shown.level, shown.of
    growing = f"{unit} {level} of {count}" if level < count else ""
    figures = [scene.figure(BEFORE, "Before", before.motion.joints, system.name)] if before else []
    ghost = BEFORE if before else None
    for n, (one, name) in enumerate(zip(made, names, strict=True)):
        told = growing or ("tokens below" if sizes and several and n == take else "")
        id = f"made{n or ''}"
        figures.append(scene.figure(id, name, one.motion.joints, system.name, told, ghost_of=ghost))
    marks = [new.ids != old.ids for new, old in zip(shown.levels, before.levels, strict=False)] if before else None
    tracks = []
    facts: tuple[Fact, ...] = (Fact("no", "tokens", NO_TOKENS),)
    if sizes:  # a system without a tokenizer has no score
        facts = (*token_facts(shown.levels), entropy_fact(shown.entropy))
        palettes = services.palettes(system.name)
        tracks.append(
            score(system, shown.motion.frames, shown.levels, palettes, shown.entropy, sizes, None, marks, CHANGED)
        )
    if several and tracks:
        track = tracks[0]
        track["name"] = f"{track['name']}, {names[take][:1].lower()}{names[take][1:]}"
    return View(
        stage=scene.payload(figures, tracks, scene=f"{wish.prompt}, {wish.seconds}"),
        facts=facts,
        controls={"prompt": wish.prompt or "", "level": level, "count": count, "unit": unit},
        seconds=seconds,
    )


def entropy_fact(entropy: Sequence[Any]) -> Fact:
    """Mean entropy over all tokens so far."""
    mean = (
        float(np.concatenate([np.asarray(row, np.float64) for row in entropy]).mean()) if len(entropy) else float("nan")
    )
    return Fact(f"{significant(mean)} bit", "mean entropy", term("entropy"))


def earlier(visit: Visit) -> str:
    """The list of the visit, newest first; "" while there is nothing to go back to."""
    if len(visit.results) < 2:
        return ""
    entries = [Entry(str(n), one.title, one is visit.shown, one.tail) for n, one in enumerate(visit.results)]
    return shelf("This visit", entries[::-1])


def onward(result: Result, take: int, editors: Sequence[str] = ()) -> str:
    """Where this motion can be taken next: links that the page follows without leaving. editors: systems that can edit,
    first the one that Edit opens with; another one of them edits its own motions."""
    made = result.takes[take]
    wish = replace(result.wish, system=made.system)
    seed = wish.seed if result.changes else made.seed
    links, name = [], made_name(wish, seed, result.changes)
    if name:
        own = {"system": (made.system,)} if made.system in editors[1:] else {}
        state = State("edit", {"motion": name, "caption": wish.prompt or "", **own})
        links.append(("Edit this motion", state))
    parts = [f'<a data-state href="{html.escape(query(state), quote=True)}">{text}</a>' for text, state in links]
    return f'<p class="mtp-aside mtp-onward">{" · ".join(parts)}</p>'


def token_card(found: "Alternatives", size: int, color: Sequence[str]) -> str:
    """What else a token could have been, as buttons. size: tokens of its scale; color: of each code listed."""
    place = f"scale {found.scale}, token {found.position + 1} of {size}"
    told = (
        f"Its chance was {_share(found.chosen_probability)}; the generator was {significant(found.entropy)} bit "
        "undecided here."
    )
    most = float(max(found.probabilities.max(), 1e-9))
    rows = "".join(
        _row(int(code), float(share), float(chance), most, tint, int(code) == found.chosen)
        for code, share, chance, tint in zip(found.codes, found.probabilities, found.chances, color, strict=True)
    )
    redrawn = "all other tokens" if found.scale == 1 else f"everything from scale {found.scale} on"
    stay = {1: "", 2: "; scale 1 stays"}.get(found.scale, f"; scales 1 to {found.scale - 1} stay")
    return (
        f'<section class="mtp-drawn" aria-label="The chosen token"><header><h2>Code {found.chosen}</h2>'
        f'<span>{place}</span><button type="button" class="mtp-back" data-deselect="generate">Back to the prompt'
        "</button></header>"
        f"<p>{told} Click another code to put it here and draw {redrawn} anew{stay}.</p>"
        f'<div class="mtp-codes">{rows}</div>'
        f'<button type="button" class="mtp-anew" data-do="anew">Draw anew from scale {found.scale} with another seed'
        "</button></section>"
    )


def _row(code: int, share: float, chance: float, most: float, tint: str, chosen: bool) -> str:
    note = "now here" if chosen else "" if chance > 0 else "cut off (top-k, top-p)"
    width = round(100 * share / most)
    return (
        f'<button type="button" data-do="code" data-code="{code}" data-key="{code}"{" disabled" if chosen else ""}'
        f' aria-label="Code {code}, {_share(share)}{", " + note if note else ""}">'
        f'<i style="background:{tint}"></i><b>{code}</b><span class="mtp-bar"><i style="width:{width}%"></i></span>'
        f"<span>{_share(share)}</span><small>{note}</small></button>"
    )


def _share(value: float) -> str:
    return f"{significant(100 * value)} %" if value >= 1e-4 else "below 0.01 %"
