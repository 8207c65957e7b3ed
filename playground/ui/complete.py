"""A state with nothing left open: what the address leaves to the page is filled in with what the page would show."""

from collections.abc import Callable
from typing import Any

from playground.systems import row_of
from playground.ui.comparing import (
    MOTION,
    VARIATIONS,
    chosen,
    settings_of,
    span_of,
    variation_of,
)
from playground.ui.drawing import MADE
from playground.ui.editing import editor_of, opening_motion
from playground.ui.mapping import first_clip
from playground.ui.origins import is_clip, is_origin, origin_caption
from playground.ui.rooms.codebooks import shown_systems
from playground.ui.rooms.embedding import first_systems
from playground.ui.rooms.guidance import reader_of
from playground.ui.services import Services
from playground.ui.state import OWN_FILE, State, controls_of


def complete(services: Services, state: State) -> State:
    """The state with every control of its room given. PlaygroundError where nothing is shipped to fill it with."""
    shown = SHOWN.get(state.room)
    filled = state.with_values(system=(shown(services, state.system)[0],)) if shown else state
    for row in controls_of(state.room):
        if filled.values.get(row.key) is None or (row.key == "motion" and not _is_there(services, filled)):
            value = row.default if row.default is not None else FILLS.get(row.key, _nothing)(services, filled)
            filled = filled.with_values(**{row.key: value})
    return _with_settings(services, filled) if state.room == "compare" else filled


def _with_settings(services: Services, state: State) -> State:
    """What is compared, one by one, as `settings`: the address names only what differs."""
    vary = variation_of(services, state["vary"])
    state = state.with_values(vary=vary)
    picked = [name for _, name in chosen(services, vary, str(state.values.get("values") or "").split("_"))]
    text = str(state["caption"] if VARIATIONS[vary].of == MOTION else state["prompt"])
    picked, numbers = picked[: VARIATIONS[vary].most], (state["seconds"], state["seed"])
    edit, usual = (str(state["kind"]), span_of(state)), services.default_system().name
    settings = settings_of(services, vary, picked, text, *numbers, *edit, state.system)
    return state.with_values(settings=settings, clip=is_clip(services, str(state["motion"])), system=(usual,))


def _is_there(services: Services, state: State) -> bool:
    """Whether the motion of a state is one that the page has, or a file that the tokenizer's room may have."""
    wanted = str(state.values["motion"])
    if state.room == "embedding-map":
        return wanted in services.bundle(str(state.system)).ids
    if state.room == "compare":
        return is_origin(services, wanted)
    return wanted.startswith((OWN_FILE, MADE)) or any(example.id == wanted for example in services.examples())


def _nothing(services: Services, state: State) -> Any:
    return None


def _system(services: Services, state: State) -> tuple[str, ...]:
    if state.room == "codebooks":
        return tuple(services.first_few(shown_systems(services)))
    return tuple(first_systems(services)) if state.room == "embedding-map" else (services.default_system().name,)


def _motion(services: Services, state: State) -> str:
    if state.room != "embedding-map":
        return opening_motion(services) if state.room == "edit" else services.opening_example().id
    bundle = services.bundle(str(state.system))
    return bundle.clips[first_clip(bundle)].id


def _caption(services: Services, state: State) -> str:
    """The motion's own caption; a file's is not known here."""
    wanted = str(state["motion"])
    if state.room == "compare":
        return origin_caption(services, wanted)
    return "" if wanted.startswith((OWN_FILE, MADE)) else services.example(wanted).caption


def _sampling(name: str) -> Callable[[Services, State], float]:
    def fill(services: Services, state: State) -> float:
        return float(getattr(row_of(str(state.system)).sampling, name))

    return fill


# Room -> which system it shows where one is asked for, not every one being able to.
SHOWN: dict[str, Callable[[Services, str | None], tuple[str, str]]] = {"edit": editor_of, "guidance": reader_of}
# Key -> what stands there when the address does not say; in the order of the table, so `motion` knows the system.
FILLS: dict[str, Callable[[Services, State], Any]] = {
    "system": _system,
    "motion": _motion,
    "caption": _caption,
    "g": _sampling("guidance"),
    "s": _sampling("cfg"),
    "temperature": _sampling("temperature"),
    "topk": _sampling("top_k"),
    "topp": _sampling("top_p"),
}
