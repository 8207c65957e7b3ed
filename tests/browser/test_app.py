"""The app that visitors get: `python -m playground app` with what is shipped in assets/. Skipped while nothing is."""

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlparse

import pytest
from playwright.sync_api import expect

from playground.analysis.bundle import read_bundle
from playground.systems import checkpoint_path
from playground.ui.services import SIDE_BY_SIDE
from tests.browser.conftest import Visit
from tests.browser.server import ROOT, serving

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
ASSETS = ROOT / "assets"
ROOMS = ("tokenize", "embedding-map", "codebooks", "generate", "guidance", "edit", "compare")


def shipped(*parts: Path) -> None:
    """Skip where one of these is not there."""
    missing = [part.relative_to(ROOT).as_posix() for part in parts if not part.exists()]
    if missing:
        pytest.skip(f"not shipped with this copy: {', '.join(missing)}")


def maps_of_systems() -> list[str]:
    """The systems whose analysis is shipped."""
    return [path.stem for path in (ASSETS / "analysis").glob("*.json")]


@pytest.fixture(scope="module")
def app() -> Iterator[str]:
    files = [checkpoint_path(ASSETS, "lgtok", part) for part in ("tokenizer", "generator")]
    shipped(*files, ASSETS / "examples" / "index.json", ASSETS / "analysis" / "lgtok.json")
    with serving("-m", "playground", "app", "--host", "127.0.0.1", "--port", "{port}") as address:
        yield address


def test_the_first_page_comes_from_stored_results_and_needs_no_torch() -> None:
    shipped(*(ASSETS / "opening" / f"{room}.json" for room in ROOMS))
    code = "import sys; from playground.ui.app import build; build(); print(*(n in sys.modules for n in HEAVY))"
    code = code.replace("HEAVY", "('torch', 'sklearn')")
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split()[-2:] == ["False", "False"], done.stderr


def test_a_visitor_meets_the_real_model_in_every_room(visit: Go, app: str) -> None:
    seen = visit(app)
    page = seen.page
    facts = page.locator("#tokenize-facts")
    expect(facts).to_contain_text("MPJPE")
    shown = re.search(r"([\d.]+)\s*mm", facts.inner_text())
    assert shown is not None and float(shown.group(1)) < 40  # the opening example comes back well

    page.locator("#tokenize-go").click()
    expect(page.locator("#tokenize-stage .ms-badge")).to_contain_text("live")

    seen.enter("Embedding map")
    expect(page.locator("#embedding-map .scatterlayer .trace .point").first).to_be_visible()
    if {"mosa", "momask"} <= set(maps_of_systems()):
        page.locator("#embedding-system input").click()
        page.get_by_role("option", name="MoSa", exact=True).click()
        page.keyboard.press("Escape")
        expect(page.locator("#embedding-stage .ms-labels")).to_contain_text("MoSa")
        expect(page.locator("#embedding-system .token")).to_have_count(3)
        page.locator("#embedding-system .token", has_text="LG-Tok").locator(".token-remove").click()
        expect(page.locator("#embedding-stage .ms-labels")).not_to_contain_text("LG-Tok")
        expect(page.locator("#embedding-facts")).to_contain_text("MoSa")
    choice = page.locator("#embedding-near input[type=radio]").first
    choice.check(force=True)
    expect(page.locator("#embedding-stage .ms-badge")).to_contain_text("live")

    seen.enter("Codebooks")
    page.get_by_role("button", name="All numbers, scale by scale").click()
    counted = [name for name in SIDE_BY_SIDE if name in maps_of_systems()]
    scales = sum(len(read_bundle(ASSETS / "analysis", name).sizes) for name in counted)
    expect(page.locator("#codebooks-table tbody tr")).to_have_count(scales)

    seen.enter("Tokenize")
    if "momask" in counted:
        page.locator("#tokenize-beside input").click()
        page.get_by_role("option", name="MoMask", exact=True).click()
        expect(page.locator("#tokenize-stage .ms-labels")).to_contain_text("MoMask")
        expect(page.locator("#tokenize-score .ms-heads")).to_contain_text("in 6 scales")
        expect(page).to_have_url(re.compile("beside=momask"))

    seen.enter("Compare")
    expect(page.locator(".mtp-compared tbody tr")).to_have_count(3)

    seen.enter("Generate")
    seen.settle()
    page.locator("#generate-prompt textarea").fill("a person walks in a circle")
    page.locator("#generate-seed input").fill("3")
    page.locator("#generate-go").click()
    expect(page.locator("#generate-stage .ms-badge")).to_contain_text("live")
    expect(page.locator("#generate-go")).to_be_enabled()
    expect(page.locator("#generate-message [role=alert]")).to_have_count(0)

    seen.enter("Guidance")
    seen.settle()
    page.locator("#guidance-caption").locator("input, textarea").fill("a person sneaks")
    page.locator("#guidance-go").click()
    expect(page.locator("#guidance-stage .ms-badge")).to_contain_text("live")

    hosts = {urlparse(url).hostname for url in seen.requests if not url.startswith(("data:", "blob:"))}
    assert hosts == {"127.0.0.1"} and seen.complaints == []


def test_the_same_seed_shows_the_same_tokens(visit: Go, app: str) -> None:
    ids = "() => MotionStage.get('generate').data.tracks[0].levels.map((level) => Array.from(level.ids ?? []))"
    found = []
    for _ in range(2):
        seen = visit(app)
        page = seen.enter("Generate")
        seen.settle()
        expect(page.locator("#generate-stage .ms-labels")).to_contain_text("Generated")
        seen.wake("#generate-go")
        page.locator("#generate-seed input").fill("11")
        page.locator("#generate-go").click()
        expect(page).to_have_url(re.compile("seed=11"))
        expect(page.locator("#generate-go")).to_be_disabled()
        expect(page.locator("#generate-go")).to_be_enabled(timeout=60_000)
        expect(page.locator("#generate-stage .ms-badge")).to_contain_text("live")  # no more what the room opened with
        page.wait_for_function(
            f"() => {{ const all = ({ids})(); return all.length === 10 && all.every((one) => one.length); }}"
        )
        found.append(page.evaluate(ids))
    assert found[0] == found[1] and len(found[0]) == 10 and all(found[0])
