"""The room Embedding map on the engine's stand-in: points, groups, distances, coordinates, a point of one's own."""

import csv
import io
import json
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from playground.analysis.bundle import Bundle
from playground.errors import PlaygroundError
from playground.ui import mapping
from playground.ui.mapping import Shown
from playground.ui.rooms import embedding
from playground.ui.services import Services
from tests.ui.double import SIZES, FakeEngine, stored_analysis

SETTINGS = (["lgtok"], "clip", "action", "tsne", "")


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine()


@pytest.fixture
def do(engine: FakeEngine) -> embedding.Handlers:
    return embedding.Handlers(Services(lambda: engine))  # type: ignore[arg-type, return-value]


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return stored_analysis()


def event(**values: Any) -> Any:
    return SimpleNamespace(**values)


@pytest.mark.parametrize("each", ["clip", "token"])
@pytest.mark.parametrize("colour", ["action", "scale", "time", "length", "source"])
def test_every_colour_has_a_map(bundle: Bundle, each: str, colour: str) -> None:
    shown = Shown(("lgtok",), each, colour).checked()
    assert shown.colour == (colour if each == "token" or colour not in ("scale", "time") else "action")
    figure = json.loads(mapping.maps([bundle], shown))
    count = len(bundle) if each == "clip" else len(bundle.token_index)
    assert sum(len(trace["x"]) for trace in figure["data"]) == 2 * count
    told = json.dumps(figure["layout"])
    assert f"{count:,} test" in told and "seed 0" in told


def test_a_token_is_coloured_by_its_place_in_time(bundle: Bundle) -> None:
    values = mapping.colours_of(bundle, Shown(("lgtok",), "token", "time"))["values"]
    for (_, scale, position), value in zip(bundle.token_index, values, strict=True):
        assert value == pytest.approx((position + 0.5) / SIZES[scale - 1])


def test_several_systems_stand_side_by_side_on_one_kind_of_map(bundle: Bundle) -> None:
    other = replace(bundle, system="lgtok-mini")
    made = mapping.clouds([bundle, other], Shown(("lgtok", "lgtok-mini"), map="pca"), {})
    assert [cloud.title.split(":")[0] for cloud in made] == ["LG-Tok", "LG-Tok mini"]
    assert all(np.array_equal(cloud.points, bundle.pca) for cloud in made) and made[0].ids == made[1].ids


def slow_mean(first: np.ndarray, second: np.ndarray, same: bool) -> float:
    pairs = [(i, j) for i in range(len(first)) for j in range(len(second)) if not (same and i == j)]
    return float(np.mean([np.linalg.norm(first[i] - second[j]) for i, j in pairs]))


def test_mean_distances_are_those_of_all_pairs() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(7, 5)), rng.normal(size=(4, 5)) + 3
    assert mapping.mean_distance(a, a) == pytest.approx(slow_mean(a, a, True))
    assert mapping.mean_distance(a, b) == pytest.approx(slow_mean(a, b, False))
    assert np.isnan(mapping.mean_distance(a[:1], a[:1]))


def test_groups_are_counted_by_action(bundle: Bundle) -> None:
    walks = [clip.id for clip in bundle.clips if clip.action == "walk"]
    sits = [clip.id for clip in bundle.clips if clip.action == "sit"]
    text = mapping.compare(bundle, "clip", [*walks, *sits[:5], "nobody"], sits[5:])
    rows = {row[0]: row[1:] for row in re.findall(r'scope="row">([^<]+)</th><td>(\d+)</td><td>(\d+)<', text)}
    assert rows == {"walk": ("30", "0"), "sit": ("5", "25"), "all": ("35", "25")}
    assert "within A" in text and "from A to B" in text and "90 test clips" in text
    assert "the rest" in mapping.compare(bundle, "clip", walks, []) and "group A" in mapping.compare(
        bundle, "clip", [], sits
    )


def test_coordinates_are_those_of_the_maps(bundle: Bundle) -> None:
    rows = list(csv.DictReader(io.StringIO(mapping.coordinates([bundle], "token"))))
    assert len(rows) == len(bundle.token_index)
    for row, (clip, scale, position), place in zip(rows, bundle.token_index, bundle.token_tsne, strict=True):
        assert (row["id"], row["scale"], row["position"]) == (bundle.ids[clip], str(scale), str(position))
        assert [float(row["tsne_x"]), float(row["tsne_y"])] == pytest.approx(place.tolist(), rel=1e-3)


def test_a_point_of_a_token_puts_its_clip_on_the_stage(do: embedding.Handlers) -> None:
    stage, _, _, current = do.click(["lgtok"], event(id="c7/5/3"))
    assert current == "c7/5/3" and json.loads(stage)["scene"] == "c7"


def test_a_new_point_is_placed_and_stays_when_the_map_changes(do: embedding.Handlers, engine: FakeEngine) -> None:
    held, plot, stage, _, near = do.place_example("m2", *SETTINGS, None)
    stars = [trace for trace in json.loads(plot)["data"] if trace["name"] == "yours"]
    assert [(trace["x"], trace["y"]) for trace in stars] == [([1.5], [2.5]), ([2.5], [1.5])]
    assert [id for _, id in near["choices"]] == ["c3", "c0", "c6"] and "placed in the map" in stage
    plot = do.draw(["lgtok"], "token", "scale", "tsne", "", held)[1]
    stars = [trace for trace in json.loads(plot)["data"] if trace["name"] == "yours"]
    assert [len(trace["x"]) for trace in stars] == [sum(SIZES)] * 2
    do.draw(["lgtok"], "clip", "action", "tsne", "", held)
    assert engine.calls.count("place clip") == 1 and engine.calls.count("tokenize") == 1


def test_other_systems_keep_what_is_on_the_stage(do: embedding.Handlers) -> None:
    settings = (["lgtok"], "clip", "action", "tsne", "c7/5/3", None)
    drawn, shown = do.draw(*settings), do.put("c7/5/3", ["lgtok"])
    assert do.choose(*settings)[1:5] == drawn[1:5]
    assert json.loads(do.choose(*settings)[5])["scene"] == "c7" and do.choose(*settings)[6:] == shown[1:]
    held = do.place_example("m2", *SETTINGS, None)[0]
    stage, _, near, current = do.choose(*settings[:5], held)[5:]
    assert "placed in the map" in stage and [id for _, id in near["choices"]] == ["c3", "c0", "c6"]
    assert current == "c7/5/3"


def test_more_maps_than_fit_are_left_out(do: embedding.Handlers, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"system{n}" for n in range(9)]
    monkeypatch.setattr(embedding, "map_systems", lambda services: names)
    assert do._known(names[::-1]) == names[:4]


def test_a_generation_is_placed(do: embedding.Handlers, engine: FakeEngine) -> None:
    held = do.place_prompt("a person waves", *SETTINGS, None)[0]
    assert held.guest.title == "“a person waves”, generated" and "place clip" in engine.calls
    with pytest.raises(PlaygroundError, match="prompt is empty"):
        do.place_prompt("  ", *SETTINGS, None)


@pytest.mark.parametrize("bad", [(["lgtok-lite"], "clip"), ([], "clip"), (["lgtok"], "frame")])
def test_settings_that_are_not_there_are_refused(do: embedding.Handlers, bad: tuple[list[str], str]) -> None:
    with pytest.raises(PlaygroundError):
        do.draw(*bad, "action", "tsne", "", None)


@pytest.mark.parametrize(("group", "ids"), [("C", ["c1"]), ("A", "c1"), (None, [])])
def test_a_group_that_is_none_is_refused(do: embedding.Handlers, group: object, ids: object) -> None:
    with pytest.raises(PlaygroundError, match="draw round"):
        do.lasso(["lgtok"], "clip", None, event(group=group, ids=ids))


def test_a_link_shows_points_colour_and_a_new_point(do: embedding.Handlers) -> None:
    query = "?room=embedding-map&each=token&colour=scale&motion=c5&place=m1"
    systems, each, kind, held, plot, colour, *_, current, prompt = do.arrive(None, event(query=query))
    assert (systems, each, kind, colour["value"], current) == (["lgtok"], "token", "tsne", "scale", "c5")
    assert prompt == ""
    assert held.guest is not None and '"yours"' in plot
    broken = do.arrive(None, event(query="?room=embedding-map&colour=time&motion=nobody&place=nobody"))
    assert broken[5]["value"] == "action" and broken[3].guest is None


def test_a_link_places_what_a_prompt_makes(do: embedding.Handlers) -> None:
    *_, prompt = shown = do.arrive(None, event(query="?room=embedding-map&prompt=a+person+%22bows%22&place=m1"))
    assert prompt == 'a person "bows"' and shown[3].guest.title == '“a person "bows"”, generated'
    assert '"yours"' in shown[4] and "placed in the map" in shown[8]


def test_a_link_with_somebody_elses_file_says_so(do: embedding.Handlers) -> None:
    shown = do.arrive(None, event(query="?room=embedding-map&place=file%3Amy+walk.npz"))
    assert shown[3].guest is None and "my walk.npz" in shown[8].text


def test_of_many_tokens_as_many_of_each_scale_are_drawn(bundle: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapping, "TOKENS", 7)
    some = mapping.drawn(bundle, "token")
    assert np.bincount(some.token_index[:, 1])[1:].tolist() == [7] * len(SIZES)
    rows = {tuple(row): n for n, row in enumerate(bundle.token_index.tolist())}
    for place, index in zip(some.token_tsne, some.token_index.tolist(), strict=True):
        assert np.array_equal(place, bundle.token_tsne[rows[tuple(index)]])
    assert mapping.drawn(bundle, "clip") is bundle
    assert mapping.sample_of([bundle], "token").startswith("70 of 200 test tokens")
    text = mapping.compare(bundle, "token", mapping.ids_of(some, "token")[:10], [])
    assert "<td>10</td><td>60</td>" in text
    assert len(mapping.coordinates([bundle], "token").splitlines()) == 1 + len(bundle.token_index)
