"""The web app: five rooms behind tabs, one engine behind all of them. `build` makes the page, `launch` serves it.

Importing this module imports no torch; the engine does so at the first live request (rule 14 of examples.md).
"""

import argparse
import os
from collections.abc import Sequence
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

os.environ.setdefault("GRADIO_ANALYTICS_ENABLED", "False")  # before gradio is imported: it reads this once
# Before torch is imported: threads that wait for each other soon sleep, and leave a shared core to others.
os.environ.setdefault("GOMP_SPINCOUNT", "20000")

import gradio as gr

from playground.limits import LIMITS
from playground.ui.bar import bar
from playground.ui.cards import tour_json
from playground.ui.chart import chart_script, plotly_script
from playground.ui.rooms import ROOMS
from playground.ui.services import EngineSource, Services
from playground.ui.state import table_json
from playground.ui.theme import style_sheet, theme

if TYPE_CHECKING:
    from playground.engine import Engine

TITLE = "Motion Token Playground"
SCRIPTS = ("page", "state", "export", "learn", "preview", "bar")  # the browser half of the page, inline in its head
UPLOADS_CHECKED_EVERY = 600  # seconds between looks for old uploaded files


@lru_cache(maxsize=1)
def _default_engine() -> "Engine":
    from playground.engine import default_engine

    return default_engine()


def build(engine: EngineSource = _default_engine) -> gr.Blocks:
    """The page. `engine` is called when something needs it first; a test passes its own."""
    services = Services(engine)
    with gr.Blocks(title=TITLE, delete_cache=(UPLOADS_CHECKED_EVERY, LIMITS.session_seconds), fill_width=True) as page:
        bar(services, TITLE)
        with gr.Tabs(elem_id="mtp-rooms", overflow_behavior="wrap"):
            for label, room in ROOMS.items():
                name = label.lower().replace(" ", "-")
                with gr.Tab(label, id=name, elem_id=f"room-{name}"):
                    room(services)
    page.queue(max_size=LIMITS.queue_size, default_concurrency_limit=1)
    return page


def launch(host: str = "127.0.0.1", port: int = 7860, engine: EngineSource = _default_engine) -> None:
    """Serve the page until the process is stopped."""
    gr.set_static_paths([plotly_script()])
    page = build(engine)
    page.launch(
        server_name=host,
        server_port=port,
        theme=theme(),
        head=_head(),
        max_file_size=LIMITS.max_upload_bytes,
        state_session_capacity=LIMITS.sessions,
        footer_links=[],
        show_error=True,
        ssr_mode=False,
        share=False,
        quiet=True,
        enable_monitoring=False,
        prevent_thread_lock=True,
    )
    if find_spec("matplotlib"):  # gradio imports it at the first event; a visitor need not wait for that
        import_module("matplotlib")
    page.block_thread()


def main(arguments: Sequence[str] | None = None) -> None:
    """`python -m playground.ui.app [--host HOST] [--port PORT]`."""
    parser = argparse.ArgumentParser(description=f"Serve the {TITLE}.")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=7860)
    options = parser.parse_args(arguments)
    launch(options.host, options.port)


def _head() -> str:
    """What goes into the page's head: our own style and scripts, inline (`css=` would rewrite our selectors)."""
    here = Path(__file__).parent
    scripts = [f"window.mtpTable = {table_json()};", f"window.mtpSteps = {tour_json()};", chart_script()]
    scripts += [(here / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS]
    return f"<style>{style_sheet()}</style>" + "".join(f"<script>{script}</script>" for script in scripts)


if __name__ == "__main__":
    main()
