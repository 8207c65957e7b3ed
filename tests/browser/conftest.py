"""Fixtures of the browser tests: one Chromium, a visit that keeps what the page asked for and complained about."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.browser.server import CHROMIUM_FLAGS, chromium, serving

expect.set_options(timeout=60_000)  # a busy machine is slow, not wrong
DESKTOP = {"width": 1280, "height": 720}
PHONE = {"width": 390, "height": 844}


@dataclass
class Visit:
    """One visitor's page with what it sent and what it complained about."""

    page: Page
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def enter(self, room: str) -> Page:
        """Open a room by its tab."""
        self.page.get_by_role("tab", name=room, exact=True).click()
        return self.page

    def settle(self) -> None:
        """Wait until the page has asked for nothing new for half a second."""
        count = -1
        while count != len(self.requests):
            count = len(self.requests)
            self.page.wait_for_timeout(500)

    def wake(self, go: str) -> None:
        """Press a button once and wait for its run: the first press wakes the whole page, which may put its own words
        back once; what is typed after that stays."""
        button = self.page.locator(go)
        button.click()
        expect(button).to_be_disabled()
        expect(button).to_be_enabled()

    def sent_since(self, mark: int) -> list[str]:
        """Requests that went out after the list had `mark` entries, streams that stay open left aside."""
        return [url for url in self.requests[mark:] if "heartbeat" not in url]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The system's Chromium."""
    path = chromium()
    if path is None:
        pytest.skip("no Chromium is installed; make setup brings one where apt is there")
    with sync_playwright() as player:
        running = player.chromium.launch(executable_path=path, args=list(CHROMIUM_FLAGS))
        yield running
        running.close()


@contextmanager
def visiting(browser: Browser) -> Iterator[Callable[..., Visit]]:
    """go(address, **context settings) opens a fresh profile on an address and waits until the page stands.

    Visitors ask for reduced motion unless told otherwise: figures then stand still until played, which spares the test
    machine."""
    contexts = []

    def go(address: str, **settings: Any) -> Visit:
        context = browser.new_context(**{"viewport": DESKTOP, "reduced_motion": "reduce", **settings})
        contexts.append(context)
        made = Visit(context.new_page())
        made.page.on("request", lambda request: made.requests.append(request.url))
        made.page.on("console", lambda line: made.complaints.append(line.text) if line.type == "error" else None)
        made.page.on("pageerror", lambda error: made.complaints.append(str(error)))
        made.page.set_default_timeout(60_000)
        made.page.goto(address)
        expect(made.page.get_by_role("tab", name="Tokenize", exact=True)).to_be_visible()
        return made

    try:
        yield go
    finally:
        for context in contexts:
            context.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[..., Visit]]:
    """`visiting`, for one test."""
    with visiting(browser) as go:
        yield go


@pytest.fixture(scope="session")
def stand_in() -> Iterator[str]:
    """Address of the page on the engine's stand-in, half a second a scale of a generation."""
    with serving("-m", "tests.ui.serve", "{port}", "0.5") as address:
        yield address
