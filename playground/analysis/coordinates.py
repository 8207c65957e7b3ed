"""The maps as a table: coordinates of clips or tokens as CSV text, with what was placed into them."""

import csv
import io
from collections.abc import Sequence
from typing import Any

from playground.errors import PlaygroundError
from playground.findings import Placed
from playground.limits import LIMITS
from playground.stored import StoredAnalysis

CLIP_COLUMNS = ("id", "origin", "action", "source", "frames", "tsne_x", "tsne_y", "pca_x", "pca_y")
TOKEN_COLUMNS = ("id", "origin", "scale", "position", "code", "second", "action", "source", "frames",
                 "tsne_x", "tsne_y", "pca_x", "pca_y")  # fmt: skip


def coordinates_csv(analysis: StoredAnalysis, each: str = "clip", placed: Sequence[tuple[str, Placed]] = ()) -> str:
    """Coordinates of every clip or of every token of the sample, one row each, columns as named in the first line.

    placed: (name, place) of motions put into the map; they follow with the origin "placed", the others are "stored".
    `second` is the middle of a token's equal share of the time. PlaygroundError for another `each`.
    """
    if each not in ("clip", "token"):
        raise PlaygroundError(f"maps are of each {str(each)[:40]!r}; clip or token is accepted")
    columns = CLIP_COLUMNS if each == "clip" else TOKEN_COLUMNS
    rows = _clips(analysis) if each == "clip" else _tokens(analysis)
    for name, place in placed:
        rows += _placed(analysis, name, place, each)
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _clips(analysis: StoredAnalysis) -> list[dict[str, Any]]:
    return [
        {"id": clip.id, "origin": "stored", "action": clip.action, "source": clip.source, "frames": clip.frames}
        | _points(analysis.tsne[row], analysis.pca[row])
        for row, clip in enumerate(analysis.clips)
    ]


def _tokens(analysis: StoredAnalysis) -> list[dict[str, Any]]:
    rows, pca = [], analysis.token_pca
    for n, (row, scale, position) in enumerate(analysis.token_index.tolist()):
        clip, level = analysis.clips[row], analysis.levels(row)[scale - 1]
        facts = {"id": clip.id, "origin": "stored", "scale": scale, "position": position}
        facts |= {"code": int(level.ids[position]), "second": _middle(position, level.size, clip.frames)}
        facts |= {"action": clip.action, "source": clip.source, "frames": clip.frames}
        rows.append(facts | _points(analysis.token_tsne[n], pca[n]))
    return rows


def _placed(analysis: StoredAnalysis, name: str, place: Placed, each: str) -> list[dict[str, Any]]:
    if place.each != each or place.system != analysis.system:
        raise PlaygroundError(f"{name[:80]!r} was placed into another map; place it into this one")
    if each == "clip":
        return [{"id": name, "origin": "placed"} | _points(place.tsne, place.pca)]
    where = [(scale, position) for scale, size in enumerate(analysis.sizes, 1) for position in range(size)]
    return [
        {"id": name, "origin": "placed", "scale": scale, "position": position} | _points(place.tsne[n], place.pca[n])
        for n, (scale, position) in enumerate(where)
    ]


def _middle(position: int, size: int, frames: int) -> float:
    return round((position + 0.5) * frames / size / LIMITS.fps, 3)


def _points(tsne: Any, pca: Any) -> dict[str, float]:
    values = (*tsne, *pca)
    return {name: round(float(v), 5) for name, v in zip(("tsne_x", "tsne_y", "pca_x", "pca_y"), values, strict=True)}
