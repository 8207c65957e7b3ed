"""How a room joins the address: it keeps its controls there on every commit, and opens a door for links to come in by.

In a room's `room(services)`, after its controls and handlers are made:

    commits(NAME, {"prompt": prompt, "seed": seed}, go.click, prompt.submit)     # browser only, no server round trip
    commits(NAME, {"motion": example}, example.input, forget=("caption",))       # another motion has its own caption
    door = link_door(NAME)                                                       # anywhere in the room; it is not seen
    arrival(door, do.arrive, [session], outputs, message, room=NAME, stage=STAGE, doing=DOING)

`do.arrive(*inputs, event: gr.EventData)` reads `asked(event)`, a State with the defaults of its room, and returns the
values of `outputs`, as every handler does: its controls first, then the result. The selection that a link holds is put
on the stage afterwards by the browser, as a commit, so the room's own `stage.select` handler hears of it.
A key of a room may be kept from several places: each call of `commits` names the keys that it knows.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gradio as gr

from playground.ui.errors import attach
from playground.ui.state import State, control, parse

_DOOR = """
const open = () => window.mtpState
  ? mtpState.door(props.room, (query) => trigger("arrive", { query }))
  : requestAnimationFrame(open);
open();
"""


def commits(room: str, controls: Mapping[str, Any], *events: Callable[..., Any], forget: Sequence[str] = ()) -> None:
    """Write these controls of a room into the address whenever one of the events happens, in the browser alone.

    controls: key of the table -> component; events: such as `button.click`; forget: keys that the address loses then,
    because what they said went with what is replaced. A system, and a number whose default is the system's own, are
    left out while they are what the component opened with; with another system all its numbers are written. KeyError
    for a key the table has not.
    """
    rows = [control(room, key) for key in (*controls, *forget)]
    own = [
        component.value if row.kind in ("number", "systems") and row.default is None else None
        for row, component in zip(rows, controls.values(), strict=False)
    ]
    keys, usual, gone = json.dumps([row.key for row in rows]), json.dumps(own), json.dumps([None] * len(forget))
    place = next((n for n, row in enumerate(rows[: len(controls)]) if row.kind == "systems"), -1)
    script = (
        f"(...values) => {{ const usual = {usual}; "
        f"const as = (i) => JSON.stringify(values[i]) === JSON.stringify(usual[i]), same = {place} < 0 || as({place}); "
        f"window.mtpState?.keep({json.dumps(room)}, {keys}, "
        f"[...values.map((value, i) => (same && as(i) ? null : value)), ...{gone}]); }}"
    )
    for event in events:
        event(None, list(controls.values()), None, js=script, api_visibility="private")


def link_door(room: str) -> gr.HTML:
    """What a link to the room comes in by; takes no place on the page."""
    return gr.HTML("", js_on_load=_DOOR, apply_default_css=False, elem_classes=["mtp-unseen"], room=room)


def arrival(
    door: gr.HTML,
    handler: Callable[..., Any],
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    message: gr.HTML,
    *,
    room: str,
    **settings: Any,
) -> None:
    """Bind what a room does when a link has asked for it; a link that comes while another one is shown waits for that.
    settings go to `errors.attach`."""
    run = attach(door.arrive, handler, inputs, outputs, message, trigger_mode="always_last", **settings)
    run.then(None, None, None, js=f"() => window.mtpState?.settled({json.dumps(room)})", api_visibility="private")


def asked(event: gr.EventData) -> State:
    """The state that a link asks for."""
    return parse(str(event.query))
