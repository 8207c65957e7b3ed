"""The line above the rooms: the name, and what works in every room: copy the link, copy as Python, export, tour, dark.

A room does nothing for the bar: the link and the script come from the address (state.py, code.py), an export from what
stands on the room's stage and in its charts (export.py). The switch to Compare in a room's panel (layout.py) and the
way back work from here too, by carry.py. The browser half is bar.js, export.js and tour.js.
"""

from typing import Any

import gradio as gr

from playground.errors import PlaygroundError
from playground.ui.carry import compared_with
from playground.ui.code import python_for
from playground.ui.complete import complete
from playground.ui.export import export_channel
from playground.ui.facts import as_sentence
from playground.ui.services import Services
from playground.ui.state import State, parse
from playground.ui.state import query as query_of

_BAR = """
<header class="mtp-header"><h1>{title}</h1>
<button type="button" class="mtp-more" aria-expanded="false" aria-controls="mtp-tools" aria-label="Tools">⋯</button>
<div class="mtp-tools" id="mtp-tools" role="group" aria-label="Tools">
<button type="button" data-part="link">Copy link</button>
<button type="button" data-part="python">Copy as Python</button>
<button type="button" data-part="export" aria-haspopup="dialog" aria-expanded="false">Export</button>
<button type="button" data-part="tour">Tour</button>
</div>
<button type="button" class="mtp-dark" aria-label="Switch between light and dark" title="Light or dark">
<span aria-hidden="true">◐</span></button>
<div class="mtp-toast" role="status"></div>
<dialog class="mtp-dialog" aria-labelledby="mtp-python-title">
<h2 id="mtp-python-title">This room as Python</h2><p class="mtp-dialog-note"></p><pre tabindex="0"><code></code></pre>
<div class="mtp-dialog-buttons"><button type="button" data-do="copy">Copy again</button>
<button type="button" data-do="close">Close</button></div></dialog>
</header>
"""
_ON_LOAD = """
const start = () => window.mtpBar
  ? mtpBar(element, (query) => server.script_of(query), (query) => server.compare_of(query))
  : requestAnimationFrame(start);
start();
"""


def bar(services: Services, title: str) -> None:
    """Build the line inside the page."""

    def script_of(query: Any) -> dict[str, str]:
        return script(services, query)

    def compare_of(query: Any) -> dict[str, str]:
        return comparison(services, query)

    gr.HTML(
        _BAR.format(title=title), elem_id="mtp-header", apply_default_css=False, js_on_load=_ON_LOAD,
        server_functions=[script_of, compare_of],
    )  # fmt: skip
    export_channel(services)


def script(services: Services, query: Any) -> dict[str, str]:
    """{"code": the script of the state that an address holds} or {"error": one sentence}."""
    state = _state(query)
    try:
        return {"code": python_for(state.room, complete(services, state))}
    except PlaygroundError as error:
        return {"error": as_sentence(str(error))}


def comparison(services: Services, query: Any) -> dict[str, str]:
    """{"query": the address of Compare that goes on from an address} or {"error": one sentence}."""
    try:
        return {"query": query_of(compared_with(services, _state(query)))}
    except PlaygroundError as error:
        return {"error": as_sentence(str(error))}


def _state(query: Any) -> State:
    """The state of an address as the browser sends it."""
    return parse(str(query[0] if isinstance(query, list) and query else query))
