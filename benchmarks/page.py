"""How quick the page is to a visitor, in a headless Chromium with software rendering: `python -m benchmarks.page`.

Everything is measured on the shipped app, started for this; the goals are those of the project.
"""

import re
import sys
import time
from collections.abc import Iterator
from statistics import median
from urllib.parse import urlencode

from playwright.sync_api import Page, expect, sync_playwright

from tests.browser.server import CHROMIUM_FLAGS, chromium, serving

SCREEN = {"width": 1280, "height": 720}
PATIENCE = 120_000  # milliseconds
FIRST_CLIPS = 4  # examples that are opened one after the other

# Frames a second in which the figures of a stage were drawn, while `each` is done once a frame of the screen.
_FRAMES = """async ([name, count, each]) => {
  const stage = MotionStage.get(name), figures = stage.figures, draw = figures.draw, act = eval(each);
  let drawn = 0;
  figures.draw = function (...given) { drawn++; return draw.apply(this, given); };
  const frame = () => new Promise(requestAnimationFrame);
  for (let n = 0; n < 20; n++) { act(stage, n); await frame(); }
  drawn = 0;
  const began = performance.now();
  for (let n = 0; n < count; n++) { act(stage, n); await frame(); }
  await frame();
  const seconds = (performance.now() - began) / 1000;
  delete figures.draw;
  return drawn / seconds;
}"""
_PLAY = "(stage, n) => { if (!stage.store.state.playing) stage.store.set({ playing: true }); }"
_SLIDE = """(stage, n) => {
  const slider = document.querySelector('#guidance-g input[type=range]');
  const most = Number(slider.max);
  Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(slider, String((n * 0.05) % most));
  slider.dispatchEvent(new Event('input', { bubbles: true }));
}"""
_SCRUB = "(stage, n) => stage.store.seek((n * 3) % stage.data.frames)"
_WATCH = """() => {
  const scene = () => MotionStage.get('tokenize').data.scene, was = scene();
  window.mtpTook = null;
  document.addEventListener('mousedown', () => {
    const pressed = performance.now();
    const look = () => {
      if (scene() === was) requestAnimationFrame(look);
      else window.mtpTook = performance.now() - pressed;
    };
    look();
  }, { capture: true, once: true });
}"""
_FOUR = "() => window.MotionStage?.get('compare')?.data?.figures?.length === 4"
_DRAWN = "() => window.MotionStage?.get('tokenize')?.joints?.('rebuilt') && document.querySelector('#tokenize-example')"


def opened(page: Page, address: str) -> float:
    """Seconds from asking for the page to figures, tokens and controls on it."""
    began = time.perf_counter()
    page.goto(address)
    page.wait_for_function(_DRAWN, timeout=PATIENCE)
    return time.perf_counter() - began


def switched(page: Page) -> Iterator[float]:
    """Seconds from the press on an example to its figures, a preset at a time."""
    for place in range(1, FIRST_CLIPS + 1):
        page.locator("#tokenize-example input").click()
        choice = page.get_by_role("option").nth(place)
        choice.wait_for()
        page.evaluate(_WATCH)
        choice.click()
        page.wait_for_function("() => window.mtpTook !== null", timeout=PATIENCE)
        yield float(page.evaluate("() => window.mtpTook")) / 1000
        page.wait_for_timeout(1_000)


def frames(page: Page, stage: str, each: str, count: int = 90) -> float:
    """Drawn frames a second."""
    return float(page.evaluate(_FRAMES, [stage, count, each]))


def measure(address: str) -> Iterator[tuple[str, float, str, float]]:
    """(what, value, unit, goal) one after the other."""
    with sync_playwright() as player:
        running = player.chromium.launch(executable_path=chromium(), args=list(CHROMIUM_FLAGS))
        page = running.new_context(viewport=SCREEN).new_page()  # type: ignore[arg-type]
        opened(page, address)  # the server's own first time
        page = running.new_context(viewport=SCREEN).new_page()  # type: ignore[arg-type]
        yield "page usable, in a fresh profile", opened(page, address), "s", 2.0
        page.wait_for_timeout(2_000)
        times = list(switched(page))
        yield "the first example of a server", times[0], "s", 0.3
        yield "another example, median of 3", median(times[1:]), "s", 0.3
        page.get_by_role("tab", name="Guidance", exact=True).click()
        page.wait_for_function("() => window.MotionStage?.get('guidance')?.joints?.('live')", timeout=PATIENCE)
        page.wait_for_timeout(2_000)
        count = page.evaluate("() => MotionStage.get('guidance').data.figures.length")
        yield f"the g slider, {count} figures", frames(page, "guidance", _SLIDE), "frames/s", 30.0
        vary = urlencode({"room": "compare", "vary": "g", "values": "0_2_4"})
        page.goto(f"{address}?{vary}")
        page.wait_for_function(
            "() => window.MotionStage?.get('compare')?.data?.figures?.length === 4", timeout=PATIENCE
        )
        expect(page.locator("#compare-stage .ms-badge")).to_have_text(re.compile("live|stored"), timeout=PATIENCE)
        page.wait_for_timeout(1_000)
        yield "scrubbing, 4 figures", frames(page, "compare", _SCRUB), "frames/s", 30.0
        yield "playing, 4 figures", frames(page, "compare", _PLAY), "frames/s", 30.0
        running.close()


def main() -> int:
    """Print a line a figure; 2 where there is no browser."""
    if chromium() is None:
        sys.stderr.write("no Chromium is installed; make setup brings one where apt is there\n")
        return 2
    with serving("-m", "playground", "app", "--port", "{port}") as address:
        for what, value, unit, goal in measure(address):
            good = value <= goal if unit == "s" else value >= goal
            sys.stdout.write(f"{what:<42}{value:>9.3g} {unit:<9} goal {goal:g} {'ok' if good else 'missed'}\n")
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
