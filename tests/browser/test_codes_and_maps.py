"""The rooms Codebooks and Embedding map as a visitor uses them: codes, tokens, groups, a point of one's own."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    return visit(stand_in)


def choose(page: Page, control: str, place: int) -> str:
    """Pick the entry number `place` of a menu; returns what it says."""
    page.locator(f"#{control} input").click()
    entry = page.get_by_role("option").nth(place)
    words = entry.inner_text().strip()
    entry.click()
    return words


def test_codebooks_show_use_perplexity_and_dead_codes(seen: Visit) -> None:
    page = seen.enter("Codebooks")
    expect(page.locator("#codebooks-facts")).to_contain_text("dead")
    page.get_by_role("button", name="All numbers, scale by scale").click()
    expect(page.locator("#codebooks-table tbody tr")).to_have_count(10)
    expect(page.locator("#codebooks-table thead")).to_contain_text("perplexity")
    panels = page.locator("#codebooks-panels .subplot")
    expect(panels).to_have_count(10)
    axis = page.locator("#codebooks-panels")
    expect(axis).to_contain_text("most used first")
    page.get_by_role("radio", name="by number").check()
    expect(axis).to_contain_text("code id")


def test_a_click_on_a_curve_shows_what_the_code_stands_for(seen: Visit) -> None:
    page = seen.enter("Codebooks")
    expect(page.locator("#codebooks-stage .ms-labels")).to_contain_text("of scale 1")
    page.wait_for_function("() => document.querySelector('#codebooks-panels .mtp-chart')?._fullLayout?.xaxis5")
    place = page.locator("#codebooks-panels .mtp-chart").evaluate(
        """(box) => {
          const { xaxis5: x, yaxis5: y } = box._fullLayout, trace = box.data[4], at = box.getBoundingClientRect();
          return [at.x + x._offset + x.d2p(trace.x[3]), at.y + y._offset + y.d2p(trace.y[3])];
        }"""
    )
    page.mouse.move(place[0], place[1] + 1)
    page.wait_for_timeout(300)
    page.mouse.click(place[0], place[1] + 1)
    expect(page.locator("#codebooks-card")).to_contain_text("scale 5")
    expect(page.locator("#codebooks-stage .ms-labels")).to_contain_text("of scale 5")
    expect(page).to_have_url(re.compile(r"code=lgtok\.5\.\d+"))
    page.reload()
    expect(page.locator("#codebooks-card")).to_contain_text("scale 5")


def test_a_hovered_point_plays_its_clip_small(seen: Visit) -> None:
    page = seen.enter("Embedding map")
    points = page.locator("#embedding-map .scatterlayer .trace .point")
    expect(points).to_have_count(182)
    seen.settle()
    card = page.locator(".mtp-preview")
    expect(card).to_be_hidden()
    mark = len(seen.requests)
    points.nth(3).hover(force=True)
    expect(card).to_be_visible()
    expect(card.locator("figcaption")).to_contain_text("a person does")
    drawn = "(box) => box.getContext('2d').getImageData(0, 0, 132, 132).data.some(Boolean)"
    assert card.locator("canvas").evaluate(drawn)
    first = card.get_attribute("data-clip")
    page.mouse.move(5, 5)
    expect(card).to_be_hidden()
    asked = len(seen.sent_since(mark))
    points.nth(12).hover(force=True)
    expect(card).to_be_visible()
    assert card.get_attribute("data-clip") != first and len(seen.sent_since(mark)) == asked  # a hover asks nobody
    assert seen.complaints == []


def test_maps_of_tokens_by_scale(seen: Visit) -> None:
    page = seen.enter("Embedding map")
    points = page.locator("#embedding-map .scatterlayer .trace .point")
    expect(points).to_have_count(182)  # 90 clips on two maps, and two rings
    page.get_by_role("radio", name="one point a token").check()
    expect(points).to_have_count(400)
    page.locator("#embedding-colour input").click()
    page.get_by_role("option", name="scale").click()
    expect(page.locator("#embedding-map")).to_contain_text("scale, coarse to fine")
    expect(page).to_have_url(re.compile("each=token&colour=scale"))
    expect(page.locator("#embedding-map")).to_contain_text("seed 0")


def test_a_lasso_compares_a_group_with_the_rest(seen: Visit) -> None:
    page = seen.enter("Embedding map")
    expect(page.locator("#embedding-map .scatterlayer .trace .point")).to_have_count(
        182
    )  # 90 clips on two maps, and two rings
    page.get_by_role("button", name="Compare two groups").click()
    page.get_by_role("radio", name="draws group A").check()
    page.wait_for_function("() => document.querySelector('#embedding-map .mtp-chart')._fullLayout.dragmode === 'lasso'")
    area = page.locator("#embedding-map .draglayer .xy .nsewdrag")
    area.scroll_into_view_if_needed()
    place = area.bounding_box()
    assert place is not None
    corners = [(0.02, 0.02), (0.98, 0.02), (0.98, 0.5), (0.02, 0.5), (0.02, 0.04)]
    for n, (x, y) in enumerate(corners):
        page.mouse.move(place["x"] + x * place["width"], place["y"] + y * place["height"], steps=4)
        if n == 0:
            page.mouse.down()
    page.mouse.up()
    expect(page.locator("#embedding-groups tbody tr").last).to_contain_text("all")
    expect(page.locator("#embedding-groups")).to_contain_text("from A to the rest")
    counts = page.locator("#embedding-groups tbody tr").last.locator("td").all_inner_texts()
    assert sum(map(int, counts)) == 90 and 0 < int(counts[0]) < 90
    page.get_by_role("button", name="Forget groups").click()
    expect(page.locator("#embedding-groups tbody tr")).to_have_count(0)


def test_an_example_is_placed_and_coordinates_are_saved(seen: Visit) -> None:
    page = seen.enter("Embedding map")
    page.get_by_role("button", name="Place a motion of your own").click()
    choose(page, "embedding-place", 1)
    expect(page.locator("#embedding-stage .ms-labels")).to_contain_text("placed in the map")
    expect(page.locator("#embedding-map .legend")).to_contain_text("yours")
    expect(page.locator("#embedding-near input[type=radio]")).to_have_count(3)
    expect(page).to_have_url(re.compile("place=m1"))
    with page.expect_download() as saved:
        page.get_by_role("button", name="Coordinates (CSV)").click()
    lines = Path(saved.value.path()).read_text().splitlines()
    assert len(lines) == 91 and lines[0].startswith("system,id,scale")
