"""What the room Embedding map draws and compares: clips or tokens as points, groups, coordinates. No model."""

import csv
import html
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.analysis.bundle import Bundle
from playground.errors import PlaygroundError
from playground.figures.maps import Cloud, maps_figure
from playground.figures.theme import percent
from playground.limits import LIMITS
from playground.systems import row_of
from playground.ui.facts import significant, table
from playground.ui.tokencard import sentence

if TYPE_CHECKING:
    from playground.findings import Placed

EACH = [("one point a clip", "clip"), ("one point a token", "token")]
COLOURS = {
    "clip": [("action", "action"), ("length", "length"), ("source", "source")],
    "token": [("action", "action"), ("scale", "scale"), ("time", "time"), ("length", "length"), ("source", "source")],
}
UNITS = {"length": "length of the clip, s", "scale": "scale, coarse to fine", "time": "place in the clip, 0 to 1"}
MAPS = [("t-SNE", "tsne"), ("PCA", "pca")]
MOST_ROWS = 8  # actions that are listed apart
TOKENS = 80  # tokens a scale that are drawn: every browser draws this many at once, also without a graphics card
SAMPLE = 1500  # points of a group that distances are taken over
HEIGHT = 420
NEIGHBOURS = 4  # that are listed
COLUMNS = ("system", "id", "scale", "position", "action", "source", "seconds", "tsne_x", "tsne_y", "pca_x", "pca_y")


@dataclass(frozen=True)
class Shown:
    """What the maps show."""

    systems: tuple[str, ...]
    each: str = "clip"
    colour: str = "action"
    map: str = "tsne"  # where several systems stand side by side; one system shows both

    def checked(self) -> "Shown":
        """The same, or action where the colour says nothing of clips. PlaygroundError for what there is not."""
        if self.each not in COLOURS or self.map not in [value for _, value in MAPS] or not self.systems:
            raise PlaygroundError("choose a system, clips or tokens, and t-SNE or PCA")
        known = [value for _, value in COLOURS[self.each]]
        return self if self.colour in known else Shown(self.systems, self.each, "action", self.map)


def drawn(bundle: Bundle, each: str) -> Bundle:
    """The bundle as the maps show it: of tokens at most TOKENS a scale, spread evenly over those that are stored."""
    if each == "clip":
        return bundle
    places = [np.flatnonzero(bundle.token_index[:, 1] == scale) for scale in range(1, len(bundle.sizes) + 1)]
    kept = [own[np.linspace(0, len(own) - 1, min(len(own), TOKENS)).astype(int)] for own in places if len(own)]
    rows = np.sort(np.concatenate(kept))
    return replace(
        bundle, token_index=bundle.token_index[rows], token_scores=bundle.token_scores[rows],
        token_tsne=bundle.token_tsne[rows],
    )  # fmt: skip


def index_of(bundle: Bundle, each: str) -> NDArray[np.int64]:
    """(row, scale from 1, position) of every point [n, 3]; scale and position are 0 for clips."""
    if each == "token":
        return np.asarray(bundle.token_index, np.int64)
    rows = np.arange(len(bundle))
    return np.stack([rows, np.zeros_like(rows), np.zeros_like(rows)], axis=1)


def ids_of(bundle: Bundle, each: str) -> list[str]:
    """What a click on a point reports: the clip's id, for a token "clip/scale/position"."""
    if each == "clip":
        return list(bundle.ids)
    return [f"{bundle.ids[row]}/{scale}/{position}" for row, scale, position in index_of(bundle, each)]


def vectors_of(bundle: Bundle, each: str) -> NDArray[np.float64]:
    """The vectors behind the points [n, D]: means of embeddings, or tokens along their main axes."""
    return np.asarray(bundle.means if each == "clip" else bundle.token_scores, np.float64)


def colours_of(bundle: Bundle, shown: Shown) -> dict[str, Any]:
    """`groups` or `values` of a Cloud."""
    index = index_of(bundle, shown.each)
    clips = [bundle.clips[row] for row in index[:, 0]]
    if shown.colour in ("action", "source"):
        return {"groups": [getattr(clip, shown.colour) for clip in clips]}
    if shown.colour == "length":
        return {"values": np.array([clip.frames for clip in clips]) / LIMITS.fps}
    if shown.colour == "scale":
        return {"values": index[:, 1]}
    sizes = np.array(bundle.sizes)
    return {"values": (index[:, 2] + 0.5) / sizes[index[:, 1] - 1]}


def clouds(bundles: Sequence[Bundle], shown: Shown, placed: Mapping[str, "Placed"]) -> list[Cloud]:
    """The panels: both maps of one system, or one map of each of several."""
    made = []
    for bundle in (drawn(one, shown.each) for one in bundles):
        index, colours = index_of(bundle, shown.each), colours_of(bundle, shown)
        notes = [_note(bundle, *place) for place in index]
        spots = placed.get(bundle.system)
        for words, name in MAPS if len(bundles) == 1 else [one for one in MAPS if one[1] == shown.map]:
            points = getattr(bundle, name if shown.each == "clip" else f"token_{name}")
            title = _title(bundle, words, shown.each)
            title = title if len(bundles) == 1 else f"{row_of(bundle.system).title}: {title}"
            new = np.zeros((0, 2)) if spots is None or spots.each != shown.each else getattr(spots, name).reshape(-1, 2)
            made.append(Cloud(title, points, ids_of(bundle, shown.each), notes, placed=new, **colours))
    return made


def maps(
    bundles: Sequence[Bundle], shown: Shown, picked: str = "", placed: Mapping[str, "Placed"] | None = None
) -> str:
    """The maps as Plotly JSON text, the point `picked` ringed; sample and seed stand on the plot."""
    figure = maps_figure(
        clouds(bundles, shown, placed or {}),
        unit=UNITS.get(shown.colour, ""), caption=sample_of(bundles, shown.each), height=HEIGHT,
        small=shown.each == "token",
    )  # fmt: skip
    figure.update_layout(meta={"picked": picked or None})
    return str(figure.to_json())


def sample_of(bundles: Sequence[Bundle], each: str) -> str:
    """Sample size, split, data and seed in a line."""
    first = bundles[0]
    shown, stored = len(drawn(first, each).token_index), len(first.token_index)
    some = f"{shown:,}" if shown == stored else f"{shown:,} of {stored:,}"
    what = f"{first.split} tokens, as many of each scale, of {len(first)} clips"
    words = f"{len(first):,} {first.split} clips" if each == "clip" else f"{some} {what}"
    return f"{words} of {first.data}, seed {first.seed}, t-SNE perplexity {first.perplexity:g}"


def about(bundle: Bundle) -> str:
    """How far to trust the maps, as a line of HTML."""
    share, chance = percent(bundle.agreement), percent(bundle.chance)
    shared = f"{share} of the ten nearest neighbours share a clip's action, {chance} by chance"
    return f'<p class="mtp-aside">{html.escape(f"{bundle.provenance}. {shared}.")}</p>'


def coordinates(bundles: Sequence[Bundle], each: str) -> str:
    """All points as CSV text: system, clip, scale, position, action, source, seconds, t-SNE and PCA coordinates."""
    out = io.StringIO()
    write = csv.writer(out)
    write.writerow(COLUMNS)
    for bundle in bundles:
        tsne, pca = (bundle.tsne, bundle.pca) if each == "clip" else (bundle.token_tsne, bundle.token_pca)
        for (row, scale, position), a, b in zip(index_of(bundle, each), tsne, pca, strict=True):
            clip = bundle.clips[row]
            token = (scale, position) if each == "token" else ("", "")
            seconds = f"{clip.frames / LIMITS.fps:.2f}"
            places = [f"{value:.5g}" for value in (*a, *b)]
            write.writerow([bundle.system, clip.id, *token, clip.action, clip.source, seconds, *places])
    return out.getvalue()


def compare(bundle: Bundle, each: str, first: Sequence[str], second: Sequence[str]) -> str:
    """Two groups of points by their ids as HTML: counts by action, mean distances. Without a second group the rest of
    the map stands for it."""
    bundle = drawn(bundle, each)
    place = {id: n for n, id in enumerate(ids_of(bundle, each))}
    a = sorted({place[id] for id in first if id in place})
    if not a:
        return '<p class="mtp-aside">Draw group A too, to compare.</p>'
    b = sorted({place[id] for id in second if id in place})
    other = "B"
    if not b:
        b, other = sorted(set(range(len(place))) - set(a)), "the rest"
    rows = index_of(bundle, each)[:, 0]
    actions = [Counter(bundle.clips[rows[n]].action for n in group) for group in (a, b)]
    names = sorted(set(actions[0]) | set(actions[1]), key=lambda name: -actions[0][name] - actions[1][name])
    lines = [[name, str(actions[0][name]), str(actions[1][name])] for name in names[:MOST_ROWS]]
    if len(names) > MOST_ROWS:
        rest = [str(sum(count[name] for name in names[MOST_ROWS:])) for count in actions]
        lines.append([f"{len(names) - MOST_ROWS} others", *rest])
    lines.append(["all", str(len(a)), str(len(b))])
    vectors = vectors_of(bundle, each)
    near = [mean_distance(vectors[one], vectors[two]) for one, two in ((a, a), (b, b), (a, b))]
    told = ("within A", f"within {other}", f"from A to {other}")
    facts = "; ".join(f"{words} {significant(value)}" for words, value in zip(told, near, strict=True))
    dims = "dimensions" if each == "clip" else "main axes"
    note = f"Mean distance in all {vectors.shape[1]} {dims}: {facts}. {sample_of([bundle], each)}."
    heads = ["points", "A", other]
    return f'{table(heads, lines, "How many of each action")}<p class="mtp-aside">{html.escape(note)}</p>'


def mean_distance(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Mean Euclidean distance between the vectors of two groups [n, D], [m, D], a point with itself left out; nan where
    there is no pair. Groups larger than SAMPLE are thinned out evenly."""
    a, b = (group[np.linspace(0, len(group) - 1, min(len(group), SAMPLE)).astype(int)] for group in (first, second))
    square = (np.square(a).sum(axis=1)[:, None] + np.square(b).sum(axis=1)) - 2 * a @ b.T
    distance = np.sqrt(np.maximum(square, 0))
    if first is second or (len(a) == len(b) and np.array_equal(a, b)):
        pairs = len(a) * (len(a) - 1)
        return float((distance.sum() - np.trace(distance)) / pairs) if pairs else float("nan")
    return float(distance.mean())


def _note(bundle: Bundle, row: int, scale: int, position: int) -> str:
    clip = bundle.clips[row]
    token = f"scale {scale}, token {position + 1} of {bundle.count(row, scale - 1)}, in: " if scale else ""
    return f"{clip.action}<br>{token}{sentence(bundle, row)}, {clip.frames / LIMITS.fps:.1f} s"


def _title(bundle: Bundle, words: str, each: str) -> str:
    if words == "PCA" and each == "clip":
        return f"PCA, {percent(sum(bundle.explained))} of the variance"
    return words


# ---- clips ----------------------------------------------------------------------------------------------------------


def first_clip(bundle: Bundle) -> int:
    """The clip to open with: of the largest action group, the one nearest to the group's middle."""
    names, counts = np.unique(bundle.actions, return_counts=True)
    rows = np.flatnonzero(np.asarray(bundle.actions) == names[counts.argmax()])
    middle = bundle.means[rows].mean(axis=0)
    return int(rows[np.square(bundle.means[rows] - middle).sum(axis=1).argmin()])


def neighbours(bundle: Bundle, row: int, count: int = NEIGHBOURS) -> list[int]:
    """Rows of the `count` clips nearest to a clip in all dimensions, nearest first."""
    distance = np.square(bundle.means - bundle.means[row]).sum(axis=1)
    distance[row] = np.inf
    return [int(other) for other in np.argsort(distance, kind="stable")[: min(count, len(bundle) - 1)]]


def listed(bundle: Bundle, rows: Sequence[int]) -> list[tuple[str, str]]:
    """Clips as choices: their words, source and length, and their ids."""
    clips = [bundle.clips[row] for row in rows]
    return [(f"{c.caption or c.action} · {c.source}, {c.frames / LIMITS.fps:.1f} s", c.id) for c in clips]
