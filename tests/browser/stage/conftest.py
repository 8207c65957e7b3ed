"""Fixtures of the stage's tests: a page that shows one payload, with all that it says and asks for."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from playground.figures.stage import Json
from playground.ui.stage.component import stage_page
from tests.browser.stage.scenes import Shown, payload

Show = Callable[..., Shown]
LISTEN = (
    "window.heard = []; for (const name of ['select', 'span', 'scale'])"
    " stage.on(name, detail => window.heard.push([name, detail]));"
)


@pytest.fixture(scope="module")
def pages(browser: Browser) -> Iterator[dict[str, Page]]:
    """One page for every kind of screen, kept: a test loads its own document into it."""
    opened: dict[str, Page] = {}
    yield opened
    for page in opened.values():
        page.context.close()


@pytest.fixture
def show(browser: Browser, pages: dict[str, Page], tmp_path: Path) -> Iterator[Show]:
    """show(payload, playing=..., **context settings) opens a page with the stage and listens to its events."""
    used: list[tuple[Page, dict[Any, Callable[[Any], None]]]] = []

    def open_page(block: Json | None = None, playing: bool = False, **settings: Any) -> Shown:
        settings = {"viewport": {"width": 900, "height": 640}, **settings}
        kind = json.dumps(settings)
        if kind not in pages:
            pages[kind] = browser.new_context(**settings).new_page()
        page = pages[kind]
        made = Shown(page)
        listeners: dict[Any, Callable[[Any], None]] = {
            "request": lambda request: made.requests.append(request.url),
            "console": lambda line: made.complaints.append(line.text) if line.type == "error" else None,
            "pageerror": lambda error: made.complaints.append(str(error)),
        }
        for event, listener in listeners.items():
            page.on(event, listener)
        used.append((page, listeners))
        path = tmp_path / "stage.html"
        path.write_text(stage_page(block or payload(), autoplay=playing), encoding="utf-8")
        page.goto(path.as_uri())
        made.until("stage && stage.data")
        made.call(LISTEN)
        made.drawn()
        return made

    yield open_page
    for page, listeners in used:
        for event, listener in listeners.items():
            page.remove_listener(event, listener)
        page.goto("about:blank")


@pytest.fixture
def shown(show: Show) -> Iterator[Shown]:
    """The stage at rest; whatever a test does with it, it asks nobody for anything and complains about nothing."""
    made = show()
    yield made
    assert made.complaints == []
    assert [url for url in made.requests if not url.startswith(("file:", "data:"))] == []
