"""`make screenshots`: photograph every room of the running app into assets/screenshots, one of them in dark."""

import sys
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from tests.browser.server import CHROMIUM_FLAGS, chromium, serving

FOLDER = Path(__file__).resolve().parent.parent / "assets" / "screenshots"
ROOMS = ("Tokenize", "Embedding map", "Codebooks", "Generate", "Guidance")
SIZE = {"width": 1280, "height": 720}
CALM = 1500  # milliseconds without a request after which a room has settled


def photograph(page: Page, room: str, name: str) -> Path:
    """Open a room by its tab, let it work, and save what is on the screen."""
    page.get_by_role("tab", name=room, exact=True).click()
    if room == "Generate":
        page.get_by_role("button", name="Generate", exact=True).click()
    requests: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    seen = -1
    while seen != len(requests):
        seen = len(requests)
        page.wait_for_timeout(CALM)
    path = FOLDER / f"{name}.png"
    page.screenshot(path=path)
    return path


def main() -> int:
    """0 if every room was photographed."""
    browser_path = chromium()
    if browser_path is None:
        print("no Chromium is installed; make setup brings one where apt is there", file=sys.stderr)
        return 1
    FOLDER.mkdir(parents=True, exist_ok=True)
    with serving("-m", "playground", "app", "--port", "{port}") as address, sync_playwright() as player:
        browser = player.chromium.launch(executable_path=browser_path, args=list(CHROMIUM_FLAGS))
        page = browser.new_page(viewport=SIZE, device_scale_factor=1, reduced_motion="reduce")
        page.goto(address)
        for room in ROOMS:
            print(photograph(page, room, room.lower().replace(" ", "-")))
        dark = browser.new_page(viewport=SIZE, color_scheme="dark", reduced_motion="reduce")
        dark.goto(address)
        print(photograph(dark, "Tokenize", "tokenize-dark"))
        browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
