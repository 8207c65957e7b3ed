"""Compare as a switch of every room: what the room shows goes on to Compare, as an address.

`compared_with(services, state)` is the address of Compare that begins where a room stands: its motion or prompt, its
words, its numbers, and what is worth varying there. A row of CARRIES is a room that has something to compare.
"""

from collections.abc import Callable, Sequence
from typing import Any

from playground.errors import PlaygroundError
from playground.ui.comparing import VARIATIONS, first_variation
from playground.ui.complete import complete
from playground.ui.services import Services
from playground.ui.state import OWN_FILE, State

Values = dict[str, Any]


def compared_with(services: Services, state: State) -> State:
    """What Compare opens with from a state of a room. PlaygroundError for a room with nothing to compare, and for a
    file of the visitor's own, which stays where it was brought to."""
    if state.room not in CARRIES:
        raise PlaygroundError("there is nothing to compare here; open one of the rooms with a motion")
    if str(state.values.get("motion") or "").startswith(OWN_FILE):
        raise PlaygroundError("your own file stays in its room; choose a motion of the library to compare settings")
    values = CARRIES[state.room](services, complete(services, state))
    return State("compare", {key: value for key, value in values.items() if value not in (None, "")}, state.hide)


def _tokenize(services: Services, state: State) -> Values:
    """The motion with its words; the scales that were kept, beside few of them and all."""
    scales, kept = state["scales"], None
    last = len(services.scales(str(state.system)))
    if scales is not None and scales.kind == "upto" and 2 < scales.n < last:
        kept = f"2_{scales.n}_{last}"
    return {"vary": "scales", "values": kept, "motion": state["motion"], "caption": state["caption"]}


def _guidance(services: Services, state: State) -> Values:
    """The motion with its words at the slider's g and at the usual ones, where g is one of those that are listed."""
    g = repr(float(state["g"])).removesuffix(".0")
    values = _listed(services, "g", sorted({*VARIATIONS["g"].usual, g}, key=float))
    return {
        "vary": "g",
        "values": values,
        "motion": state["motion"],
        "caption": state["caption"],
        **_own(services, state),
    }


def _generate(services: Services, state: State) -> Values:
    """Several seeds stay seeds; one motion is compared over the generator's guidance."""
    seeds = _listed(services, "seed", [str(state["seed"] + n) for n in range(state["takes"])])
    several = state["takes"] > 1 and seeds is not None
    words = {} if state["free"] else {"prompt": state["prompt"]}
    numbers = {"seconds": state["seconds"], "seed": state["seed"]}
    vary = {"vary": "seed" if several else "s", "values": seeds if several else None}
    return vary | words | numbers | _own(services, state)


def _edit(services: Services, state: State) -> Values:
    """The same edit of the same motion, drawn with other seeds."""
    values = _listed(services, "redraw", [str(state["seed"] + n) for n in range(3)])
    keys = ("motion", "caption", "prompt", "kind", "from", "to", "seed")
    return {"vary": "redraw", "values": values, **{key: state.values.get(key) for key in keys}, **_own(services, state)}


def _endless(services: Services, state: State) -> Values:
    """The first instruction, as clips of a given length."""
    return {"vary": "s", "prompt": state["prompt"], "seed": state["seed"]}


def _codebooks(services: Services, state: State) -> Values:
    """The systems side by side, on a motion; with one system alone what its scales add."""
    return {"vary": first_variation(services)}


def _embedding_map(services: Services, state: State) -> Values:
    """The clip that is ringed, or what was placed, as the systems or the scales rebuild it."""
    placed = str(state["place"] or "")
    own = placed if placed and not placed.startswith(OWN_FILE) else state["motion"]
    return {"vary": first_variation(services), "motion": own}


def _own(services: Services, state: State) -> Values:
    """The system of the room, where it is not the one that the page prefers anyway."""
    return {} if state.system == services.default_system().name else {"system": (state.system,)}


def _listed(services: Services, vary: str, values: Sequence[str]) -> str | None:
    """The values as an address holds them, None where one of them is none that Compare lists."""
    known = {name for _, name in VARIATIONS[vary].choices(services)}
    return "_".join(values) if set(values) <= known else None


CARRIES: dict[str, Callable[[Services, State], Values]] = {
    "tokenize": _tokenize,
    "embedding-map": _embedding_map,
    "codebooks": _codebooks,
    "generate": _generate,
    "guidance": _guidance,
    "edit": _edit,
    "endless": _endless,
}
