"""Maps: every motion once, in its group, with its id; names of groups that do not lie on each other."""

import json

import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.figures.embedding import embedding_maps


def cloud(n: int, seed: int = 0) -> tuple[np.ndarray, list[str], list[str]]:
    rng = np.random.default_rng(seed)
    actions = [str(name) for name in rng.choice(["walk", "run", "wave", "kick"], n)]
    return rng.normal(size=(n, 2)), actions, [f"clip {i}" for i in range(n)]


def test_every_motion_stands_once_with_its_id() -> None:
    points, actions, ids = cloud(60)
    figure = embedding_maps({"t-SNE": points}, actions, ids, caption="60 clips, seed 0")
    seen = {}
    for trace in figure.data:
        for x, y, id in zip(trace.x, trace.y, trace.customdata, strict=True):
            seen[id] = (x, y, trace.name)
    assert len(seen) == 60
    for i, id in enumerate(ids):
        assert seen[id][2] == actions[i]
        assert seen[id][:2] == pytest.approx(points[i], abs=1e-4)
    assert len({(trace.marker.color, trace.marker.symbol) for trace in figure.data}) == 4
    assert isinstance(json.loads(figure.to_json())["data"][0]["x"], list)


def test_two_maps_share_one_legend() -> None:
    points, actions, ids = cloud(60)
    figure = embedding_maps({"t-SNE": points, "PCA": points * 3}, actions, ids, explained={"PCA": [0.5, 0.2]})
    assert sum(bool(trace.showlegend) for trace in figure.data) == 4 and len(figure.data) == 8
    assert "50 % of the variance" in figure.layout.xaxis2.title.text
    assert figure.layout.xaxis.showticklabels is False


def test_names_of_groups_keep_apart() -> None:
    points, actions, ids = cloud(200)
    figure = embedding_maps({"map": points * 0.01}, actions, ids)
    names = [note for note in figure.layout.annotations if note.text.startswith("<b>")]
    assert {note.text for note in names} == {f"<b>{action}</b>" for action in set(actions)}
    height = np.ptp(points[:, 1]) * 0.01
    rows = sorted(note.y for note in names)
    assert all(b - a > 0.04 * height for a, b in zip(rows, rows[1:], strict=False)) or len({n.x for n in names}) > 1


@pytest.mark.parametrize("n", [1, 2, 12])
def test_points_that_fall_together_are_drawn(n: int) -> None:
    figure = embedding_maps({"map": np.zeros((n, 2))}, ["walk"] * n, [str(i) for i in range(n)])
    low, high = figure.layout.xaxis.range
    assert low < 0 < high


@pytest.mark.parametrize(
    "points, actions, ids, notes",
    [
        (np.zeros((2, 2)), ["walk"], ["a", "b"], None),
        (np.zeros((2, 2)), ["walk"] * 2, ["a"], None),
        (np.zeros((2, 3)), ["walk"] * 2, ["a", "b"], None),
        (np.full((2, 2), np.nan), ["walk"] * 2, ["a", "b"], None),
        (np.zeros((2, 2)), ["walk"] * 2, ["a", "b"], ["one"]),
    ],
)
def test_what_does_not_fit_is_refused(points, actions, ids, notes) -> None:
    with pytest.raises(PlaygroundError):
        embedding_maps({"map": points}, actions, ids, notes=notes)


def test_no_map_is_refused() -> None:
    with pytest.raises(PlaygroundError):
        embedding_maps({}, [], [])
