"""The rooms with every system of the table, by what a system has: tiny checkpoints, the real engine, the real page.

One server and one page for the whole file, as a visitor who goes through the systems would have it.
"""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from playground.engine import Engine
from playground.systems import SYSTEMS
from playground.ui.state import parse
from tests.browser.conftest import Visit, visiting
from tests.browser.server import serving
from tests.tiny_systems import TRAINED
from tests.ui.serve_systems import ANALYSED

pytestmark = pytest.mark.browser
TOKENIZE = [name for name in TRAINED if SYSTEMS[name].tokenizer]
GENERATE = [name for name in TRAINED if SYSTEMS[name].generator]
EDIT = [name for name in GENERATE if name in TOKENIZE]
WORDLESS = "has no decoder that reads words"
# What stands on a stage now is not what stood there before, and a condition on it: `data`, its first track `track`.
SHOWN = """([room, condition]) => {
  const data = window.MotionStage?.get(room)?.data;
  if (!data?.figures || data === window.mtpSeen) return false;
  const track = data.tracks[0], whole = (track?.levels ?? []).every((level) => level.ids);
  return new Function('data', 'track', 'whole', `return ${condition}`)(data, track, whole);
}"""
REMEMBER = "(room) => { window.mtpSeen = window.MotionStage?.get(room)?.data; }"


@pytest.fixture(scope="module")
def engine(tmp_path_factory: pytest.TempPathFactory) -> Engine:
    """The engine on the folder that the server fills; asked for what headers say alone."""
    return Engine(tmp_path_factory.mktemp("assets"))


@pytest.fixture(scope="module")
def visitor(browser: Browser, engine: Engine) -> Iterator[Visit]:
    """The one page of this file."""
    with serving("-m", "tests.ui.serve_systems", "{port}", str(engine.assets)) as address, visiting(browser) as go:
        seen = go(address)
        seen.settle()
        yield seen


@pytest.fixture
def page(visitor: Visit) -> Iterator[Page]:
    """The page, which has nothing to complain of before and after a test."""
    visitor.complaints.clear()
    yield visitor.page
    expect(visitor.page.locator(".mtp-error:visible")).to_have_count(0)
    assert visitor.complaints == []


def shown(page: Page, room: str, condition: str) -> Any:
    """Wait for something new on a stage."""
    page.wait_for_function(SHOWN, arg=[room, condition])
    return page.evaluate(REMEMBER, room)


def follow(page: Page, address: str) -> None:
    """Open an address inside the page, as a link does; `shown` then waits for what it brings."""
    page.evaluate(REMEMBER, parse(address).room.removesuffix("-map"))
    page.evaluate("(address) => window.mtpState.open(address)", address)


def choose(page: Page, room: str, name: str) -> None:
    """A system in the menu of a room; its tokens, where it shows a motion at once."""
    tab = page.locator(f"#room-{room}-button")
    tab.click()
    expect(tab).to_have_attribute("aria-selected", "true")
    menu, title = page.locator(f"#{room}-system input"), SYSTEMS[name].title
    page.evaluate(REMEMBER, room)
    changes = menu.input_value() != title
    menu.click()
    page.get_by_role("option", name=re.compile(f"^\\W*{re.escape(title)}$")).click()
    expect(menu).to_have_value(title)
    if changes and room != "generate":
        shown(page, room, f"track.system === '{name}'")
    page.evaluate("() => { window.mtpSeen = null; }")


@pytest.mark.parametrize("name", TOKENIZE)
def test_a_motion_becomes_tokens_and_comes_back(page: Page, engine: Engine, name: str) -> None:
    follow(page, f"?room=tokenize&system={name}")
    count = len(engine.scales(name))
    shown(page, "tokenize", f"track.system === '{name}' && whole && track.levels.length === {count}")
    expect(page.locator("#tokenize-stage .ms-labels")).to_contain_text(SYSTEMS[name].title)
    expect(page.locator("#tokenize-score .ms-heads")).to_contain_text("scale")
    scales = page.locator("#tokenize-scales input[type=range]")
    expect(scales).to_have_attribute("max", str(max(2, count)))
    expect(scales).to_have_value(str(count))
    expect(scales).to_be_disabled() if count == 1 else expect(scales).to_be_enabled()


@pytest.mark.parametrize("name", ANALYSED)
def test_a_token_under_the_microscope_and_codes(page: Page, engine: Engine, name: str) -> None:
    follow(page, f"?room=tokenize&system={name}")
    count = len(engine.scales(name))
    shown(page, "tokenize", f"track.system === '{name}' && whole")
    chosen = f"{{ selection: {{ system: '{name}', scale: {count}, position: 0 }} }}"
    page.evaluate(f"() => MotionStage.get('tokenize').store.commit('select', {chosen})")
    card = page.locator("#tokenize-card .mtp-token")
    expect(card).to_contain_text(f"scale {count}, token 1 of")
    expect(card.locator(".mtp-governs")).to_contain_text(re.compile("measured", re.IGNORECASE))
    card.get_by_role("button", name="Back to the motion").click()
    expect(card).to_have_count(0)
    follow(page, f"?room=codebooks&system={name}&code={name}.{count}.3")
    expect(page.locator("#codebooks-card")).to_contain_text(f"scale {count}")
    follow(page, f"?room=embedding-map&system={name}")
    shown(page, "embedding", f"track.system === '{name}' && track.levels.length === {count}")


@pytest.mark.parametrize("name", GENERATE)
def test_words_become_a_motion(page: Page, engine: Engine, name: str) -> None:
    choose(page, "generate", name)
    page.evaluate(REMEMBER, "generate")
    page.locator("#generate-go").click()
    ready = f"data.figures[0].system === '{name}' && !/ of /.test(data.figures[0].caption) && whole"
    shown(page, "generate", f"{ready} && (track?.levels.length ?? 0) === {len(engine.scales(name))}")
    told = page.locator("#generate-facts")
    if name in TOKENIZE:
        expect(page.locator("#generate-score .ms-heads")).to_contain_text(SYSTEMS[name].title)
        expect(told).to_contain_text("mean entropy")
    else:
        expect(told.locator("[data-card*='writes no tokens']")).to_have_count(1)
    expect(page.locator("#generate-go")).to_be_enabled()


@pytest.mark.parametrize("name", EDIT)
def test_a_span_is_repainted(page: Page, name: str) -> None:
    choose(page, "edit", name)
    strength = page.locator("#edit-s input[type=range]")
    if not strength.is_visible():
        page.locator("#room-edit .mtp-knobs > button").first.click()  # "More"
    expect(strength).to_have_value(f"{SYSTEMS[name].sampling.cfg:g}")
    page.evaluate(REMEMBER, "edit")
    page.locator("#edit-go").click()
    after = f"data.figures.length === 2 && data.figures[1].system === '{name}' && data.hatch.length"
    shown(page, "edit", f"{after} && track.system === '{name}' && whole")
    expect(page.locator("#edit-facts")).to_contain_text("frames kept")


def test_the_last_generation_brings_its_system_along(page: Page) -> None:
    choose(page, "generate", "mogo")
    page.evaluate(REMEMBER, "generate")
    page.locator("#generate-go").click()
    shown(page, "generate", "track?.system === 'mogo' && whole")
    choose(page, "edit", "momask")
    page.evaluate(REMEMBER, "edit")
    page.locator("#edit-last").click()
    shown(page, "edit", "data.figures.length === 1 && track.system === 'mogo'")
    expect(page.locator("#edit-system input")).to_have_value("MOGO")
    expect(page).to_have_url(re.compile(r"motion=made_[^&]*_mogo.*system=mogo|system=mogo.*motion=made_[^&]*_mogo"))


def test_g_acts_where_the_decoder_reads_words(page: Page, engine: Engine) -> None:
    readers = [name for name in TOKENIZE if engine.reads_words(name)]
    assert "lgtok" in readers and "lgtok-notext" not in readers and "momask" not in readers
    for name in readers:
        choose(page, "guidance", name)
        shown(page, "guidance", f"track.system === '{name}' && data.figures.length === 6 && data.features")
    follow(page, "?room=guidance&system=momask")
    expect(page.locator("#guidance-message")).to_contain_text(f"MoMask {WORDLESS}")
    expect(page.locator("#guidance-system input")).to_have_value("LG-Tok")


@pytest.mark.parametrize("vary", ["system&values=momask_t2mgpt", "maker&values=momask_t2mgpt", "maker&values=mdm_mosa"])
def test_two_systems_stand_side_by_side(page: Page, vary: str) -> None:
    names = vary.split("=")[1].split("_")
    tracks = [name for name in names if name in TOKENIZE]
    follow(page, f"?room=compare&vary={vary}&seconds=2")
    both = " && ".join(f"data.figures.some((one) => one.system === '{name}')" for name in names)
    shown(page, "compare", f"data.tracks.length === {len(tracks)} && {both}")
    expect(page.locator("#compare-take tbody tr")).to_have_count(2)


def test_an_edit_goes_on_to_compare_with_its_system(page: Page) -> None:
    choose(page, "edit", "momaskpp")
    page.evaluate(REMEMBER, "compare")
    page.locator("#room-edit [data-part=compare]").click()
    shown(page, "compare", "data.tracks.length === 1 && track.system === 'momaskpp' && data.figures.length === 4")


def test_a_motion_without_end(page: Page) -> None:
    page.locator("#room-endless-button").click()
    page.locator("#endless-go").click()
    shown(page, "endless", "data.figures[0].system === 'mogo' && data.growing")
    page.locator("#endless-stop").click()
    expect(page.locator("#endless-stop")).to_be_disabled()
