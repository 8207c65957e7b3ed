"""What the room Compare shows: the figures in sync, the tokens of one of them, a table with the best marked."""

import html
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from playground.figures import stage as scene
from playground.figures.stage import ORIGINAL_ID, Json
from playground.motion.motion import Motion
from playground.ui.comparing import EDIT, EDIT_TITLES, MOTION, PROMPT, Compared, Setting
from playground.ui.facts import bits_text, significant
from playground.ui.scenes import score
from playground.ui.services import Services
from playground.ui.view import View

# What the table shows of a result: head, the number, how it is written; less is better in every one of them.
Column = tuple[str, Callable[[Compared], float | None], Callable[[float], str]]
ERROR: Column = ("MPJPE, mm", lambda one: one.error_mm, significant)
OTHER: Column = ("from the first, mm", lambda one: one.error_mm, significant)
CHANGE: Column = ("from before, mm", lambda one: one.error_mm, significant)
FIRSTS = {MOTION: ERROR, PROMPT: OTHER, EDIT: CHANGE}
COLUMNS: tuple[Column, ...] = (
    ("tokens", lambda one: float(one.tokens) or None, lambda value: f"{value:.0f}"),
    ("to store", lambda one: one.bits or None, bits_text),
    ("foot sliding, mm/s", lambda one: one.sliding, significant),
    ("time, s", lambda one: one.seconds, significant),
)
DIFFERS = "another code than the first"


def compared_view(services: Services, done: Sequence[Compared], source: Motion | None, name: str, take: int) -> View:
    """The results so far. source: the motion that went through, None for motions from a prompt; name: of the motion or
    the prompt; take: whose tokens the score shows."""
    take = min(take, len(done) - 1)
    of = PROMPT if source is None else EDIT if done[0].setting.kind else MOTION
    return View(
        stage=_scene(services, done, source, name, take),
        controls={"table": compared_table(services, done, of, name, take)},
        seconds=sum(one.seconds for one in done),
    )


def _scene(services: Services, done: Sequence[Compared], source: Motion | None, name: str, take: int) -> Json:
    figures = []
    if source is not None:
        figures.append(scene.figure(ORIGINAL_ID, "Original", _cut(source, done[0])))
    for n, one in enumerate(done):
        rebuilt = source is not None and one.error_mm is not None and not one.setting.kind
        told = f"MPJPE {significant(one.error_mm)} mm" if rebuilt and one.error_mm is not None else ""
        ghost = ORIGINAL_ID if source is not None else None
        figures.append(
            scene.figure(f"one{n}", one.setting.name, one.motion.joints, one.setting.system, told, ghost_of=ghost)
        )
    shown = {one.setting.system: one for one in reversed(done)}  # the first of every system,
    shown[done[take].setting.system] = done[take]  # or the one that is looked at
    order = list(dict.fromkeys(one.setting.system for one in done))
    tracks = [
        _track(services, one, done[0], several=len(done) > 1)
        for one in (shown[system] for system in order)
        if one.levels  # a system without a tokenizer has no score
    ]
    return scene.payload(figures, tracks, scene=f"compare {name} {len(done)}")


def _cut(source: Motion, one: Compared) -> Any:
    """The poses of the original that were tokenized, put where it stands."""
    from playground.engine.checks import prepare

    return prepare(source)[1].joints[: one.motion.frames]


def _track(services: Services, one: Compared, first: Compared, several: bool) -> Json:
    system = next(info for info in services.engine().systems() if info.name == one.setting.system)
    same = one is first or one.setting.system != first.setting.system
    marks = None if same else [_unlike(a.ids, b.ids) for a, b in zip(one.levels, first.levels, strict=False)]
    if marks is not None and len(marks) < len(one.levels):
        marks += [np.zeros(level.size, bool) for level in one.levels[len(marks) :]]
    marks = marks if marks is not None and any(mark.any() for mark in marks) else None
    sizes = services.sizes(system.name, one.motion.frames)
    track = score(
        system, one.motion.frames, one.levels, services.palettes(system.name), sizes=sizes, marks=marks, marked=DIFFERS
    )
    if several and one.setting.name != system.title:
        track["name"] = f"{track['name']}, {one.setting.name[:1].lower()}{one.setting.name[1:]}"
    return track


def _unlike(ids: Any, others: Any) -> Any:
    """Where two rows of tokens differ, bool [s]; one that the other row has not differs."""
    marks = np.ones(len(ids), bool)
    common = min(len(ids), len(others))
    marks[:common] = ids[:common] != others[:common]
    return marks


def compared_table(services: Services, done: Sequence[Compared], of: str, name: str, take: int) -> str:
    """One row a setting, the best of each column marked where they differ; a name picks whose tokens are shown."""
    columns = (FIRSTS[of], *COLUMNS)
    best = [None if of != MOTION and n == 0 else best_of(done, column) for n, column in enumerate(columns)]
    heads = "".join(f'<th scope="col">{head}</th>' for head, _, _ in columns)
    rows = ""
    for n, one in enumerate(done):
        cells = "".join(_cell(column, one, n in (best[k] or ())) for k, column in enumerate(columns))
        rows += f'<tr><th scope="row">{_name(one, n, n == take)}</th>{cells}</tr>'
    systems = list(dict.fromkeys(one.setting.system for one in done))
    told = measured_on(services, done[0].setting, of, name, systems)
    return (
        '<div class="mtp-table-box"><table class="mtp-table mtp-compared"><thead><tr><th scope="col"></th>'
        f"{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
        f'<p class="mtp-aside mtp-small">{html.escape(told)}</p>'
    )


def best_of(done: Sequence[Compared], column: Column) -> set[int] | None:
    """Rows with the least value as it is written; None where there is nothing to choose between."""
    _, number, write = column
    values = [number(one) for one in done]
    there = [value for value in values if value is not None and math.isfinite(value)]
    if len(there) < 2:
        return None
    least = write(min(there))
    found = {n for n, value in enumerate(values) if value is not None and write(value) == least}
    return None if len(found) == len(there) else found


def measured_on(services: Services, setting: Setting, of: str, name: str, systems: Sequence[str]) -> str:
    """What the numbers of the table were measured on, in a line."""
    system = "; ".join(_with_checkpoint(services, name) for name in systems)
    if of == MOTION:
        return f"This clip, {name}; {system}; time of tokenizing and decoding. Bold is best: the least."
    if of == EDIT:
        where = "the middle or the half" if setting.span is None else "{:g} to {:g} s".format(*setting.span)
        what = f"“{setting.text}” in {name}, {where}, {EDIT_TITLES[setting.kind].lower()} unless it says otherwise"
        return f"{what}; {system}; time of tokenizing, drawing and decoding. Bold is best: the least."
    drawn = f"“{name}”, {setting.seconds:g} s, one motion each; {system}"
    return f"{drawn}; time of drawing and decoding. Bold is best: the least."


def _with_checkpoint(services: Services, system: str) -> str:
    checkpoint = services.checkpoint(system)[:8]
    return f"{system}, checkpoint {checkpoint}" if checkpoint else system


def _name(one: Compared, place: int, shown: bool) -> str:
    title = "Its tokens are below" if shown else "Show its tokens below"
    data = f'data-do="show" data-code="{place}" data-key="{place}" aria-pressed="{str(shown).lower()}"'
    return f'<button type="button" {data} title="{title}">{html.escape(one.setting.name)}</button>'


def _cell(column: Column, one: Compared, best: bool) -> str:
    _, number, write = column
    value = number(one)
    text = "–" if value is None or not math.isfinite(value) else html.escape(write(value))
    return f"<td><strong>{text}</strong></td>" if best else f"<td>{text}</td>"
