"""The export menu: one file of every kind, progress, stopping, and what a room without a stage offers."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from playground.motion.formats import read_motion
from playground.tokenizers.token_file import TokenFile
from tests.browser.conftest import PHONE, Visit
from tests.ui.double import SIZES

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
DRAWN = "() => [...document.querySelectorAll('#room-codebooks .mtp-chart')].every((box) => box.data)"
PANELS = "() => JSON.stringify(document.querySelector('#codebooks-panels .mtp-chart').data)"
SLOW = 180_000  # milliseconds that a picture may take on a busy machine


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    return visit(stand_in, accept_downloads=True)


def menu(page: Page) -> Locator:
    """The opened export menu."""
    page.get_by_role("button", name="Export", exact=True).click()
    return page.get_by_role("dialog", name="Export")


def download(page: Page, button: Locator, folder: Path) -> Path:
    with page.expect_download(timeout=SLOW) as coming:
        button.click()
    path = folder / coming.value.suggested_filename
    coming.value.save_as(path)
    return path


def test_motions_and_tokens(seen: Visit, tmp_path: Path) -> None:
    page = seen.page
    page.wait_for_function(
        "() => window.MotionStage?.get('tokenize')?.data?.tracks[0]?.levels.every((level) => level.ids)"
    )
    box = menu(page)
    box.get_by_label("Figure to write").select_option(label="From tokens")
    shown = page.evaluate("() => Array.from(MotionStage.get('tokenize').joints('rebuilt'))")
    paths = [download(page, box.get_by_role("button", name=kind), tmp_path) for kind in ("NPZ", "BVH", "GLB", "JSON")]
    with np.load(paths[0]) as file:
        assert np.allclose(file["joints"].ravel(), shown, atol=1e-5)
    assert read_motion(paths[1]).motion.frames > 10 and paths[2].read_bytes()[:4] == b"glTF"
    tokens = TokenFile.read(paths[3])
    assert [level.size for level in tokens.levels] == list(SIZES) and tokens.caption
    assert all(set(path.name) <= set("abcdefghijklmnopqrstuvwxyz0123456789-.") for path in paths)
    expect(box.get_by_role("status")).to_contain_text(f"Saved {paths[3].name}")
    page.keyboard.press("Escape")
    expect(box).to_be_hidden()
    assert seen.complaints == []


def test_a_film_a_loop_and_a_strip(visit: Go, stand_in: str, tmp_path: Path) -> None:
    seen = visit(stand_in + "?room=generate&prompt=a+person+jogs&seconds=1", accept_downloads=True)
    page = seen.page
    expect(page.locator("#generate-stage .ms-time")).to_contain_text("1.00 s")
    expect(page.locator("#generate-go")).to_be_enabled()
    box = menu(page)
    film = download(page, box.get_by_role("button", name="MP4"), tmp_path)
    assert film.name.startswith("generate-a-person-jogs") and film.read_bytes()[4:8] == b"ftyp"
    loop = download(page, box.get_by_role("button", name="GIF"), tmp_path)
    with Image.open(loop) as picture:
        assert picture.n_frames == 10
    strip = download(page, box.get_by_role("button", name="Pose strip"), tmp_path)
    with Image.open(strip) as picture:
        assert picture.format == "PNG" and picture.width > picture.height
    assert seen.complaints == []


def test_a_film_can_be_stopped(seen: Visit) -> None:
    page = seen.page
    page.wait_for_function("() => window.MotionStage?.get('tokenize')?.data")
    box = menu(page)
    box.get_by_role("button", name="MP4").click()
    expect(box.get_by_role("button", name="MP4")).to_be_disabled()
    box.get_by_role("button", name="Stop").click()
    expect(box.get_by_role("status")).to_contain_text("Stopped; nothing was saved.")
    expect(box.get_by_role("button", name="MP4")).to_be_enabled()


def test_plots(seen: Visit, tmp_path: Path) -> None:
    page = seen.enter("Codebooks")
    page.wait_for_function(DRAWN)
    box = menu(page)
    expect(box.get_by_role("button", name="BVH")).to_have_count(1)  # the motion that a code stands for
    png, svg, table = (
        download(page, box.get_by_role("button", name=kind).first, tmp_path) for kind in ("PNG", "SVG", "CSV")
    )
    with Image.open(png) as picture:
        assert picture.format == "PNG" and picture.width > 1_000
    assert svg.read_text(encoding="utf-8").startswith("<svg")
    rows = list(csv.DictReader(io.StringIO(table.read_text(encoding="utf-8"))))
    drawn = json.loads(
        page.evaluate("() => JSON.stringify(document.querySelector('#codebooks-panels .mtp-chart').data)")
    )
    assert len(rows) == sum(len(trace["x"]) for trace in drawn if trace.get("hoverinfo") != "skip")
    assert {row["panel"] for row in rows} == {str(n) for n in range(1, 11)}
    assert [float(row["y"]) for row in rows[:5]] == drawn[0]["y"][:5]
    assert [row["id"] for row in rows[:5]] == [known[0] for known in drawn[0]["customdata"][:5]]


def test_where_nothing_is_shown_the_menu_says_so(visit: Go, stand_in: str) -> None:
    page = visit(stand_in + "?room=learn").page
    expect(page.locator("#learn-page")).to_be_visible()
    expect(menu(page)).to_contain_text("nothing to export here")


def test_on_a_phone_the_menu_fits(visit: Go, stand_in: str) -> None:
    page = visit(stand_in, viewport=PHONE, has_touch=True, is_mobile=True).page
    page.wait_for_function("() => window.MotionStage?.get('tokenize')?.data")
    page.get_by_role("button", name="Tools").click()
    box = menu(page).bounding_box()
    assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= PHONE["width"]
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
