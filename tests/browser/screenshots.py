"""Photograph every room: `python -m tests.browser.screenshots [--out DIR] [--stand-in]`, called by `make screenshots`.

Desktop 1280x720, a phone 390x844 from top to bottom, both light and dark, of the app with the shipped checkpoints; with
--stand-in of the app on the engine's stand-in. The folder is ignored by git.
"""

import argparse
import sys
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

from tests.browser.server import CHROMIUM_FLAGS, ROOT, chromium, serving

ROOMS = ("Tokenize", "Embedding map", "Codebooks", "Generate", "Guidance", "Edit", "Compare", "Endless", "Learn")
SIZES = {"desktop": {"width": 1280, "height": 720}, "phone": {"width": 390, "height": 844}}
STANDING = 1_500  # milliseconds for charts to be drawn and figures to take a step
STAGES = ["tokenize", "embedding", "generate", "guidance", "edit", "compare", "endless"]
LATER = f"() => {STAGES}.forEach((name) => MotionStage.get(name)?.seek(24))"


def photograph(browser: Browser, address: str, folder: Path) -> list[Path]:
    """All pictures of the app at `address`; returns their paths."""
    made = []
    for device, size in SIZES.items():
        for scheme in ("light", "dark"):
            context = browser.new_context(viewport=size, color_scheme=scheme, reduced_motion="reduce")
            page = context.new_page()
            page.goto(address)
            for room in ROOMS:
                page.get_by_role("tab", name=room, exact=True).click()
                page.wait_for_timeout(STANDING)
                page.evaluate(LATER)
                page.wait_for_timeout(STANDING // 3)
                path = folder / f"{room.lower().replace(' ', '-')}-{device}-{scheme}.png"
                page.screenshot(path=path, full_page=device == "phone")
                made.append(path)
            context.close()
    return made


def main() -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(description="Photograph every room of the app.")
    parser.add_argument("--out", type=Path, default=ROOT / "screenshots")
    parser.add_argument("--stand-in", action="store_true", help="the app on the engine's stand-in")
    options = parser.parse_args()
    path = chromium()
    if path is None:
        sys.stderr.write("no Chromium is installed; make setup brings one where apt is there\n")
        return 2
    options.out.mkdir(parents=True, exist_ok=True)
    command = ("tests.ui.serve", "{port}") if options.stand_in else ("playground", "app", "--port", "{port}")
    with serving("-m", *command) as address, sync_playwright() as player:
        browser = player.chromium.launch(executable_path=path, args=list(CHROMIUM_FLAGS))
        made = photograph(browser, address, options.out)
        browser.close()
    sys.stdout.write(f"{len(made)} pictures in {options.out}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
