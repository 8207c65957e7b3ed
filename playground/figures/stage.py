"""The stage's payload: one JSON object built from numpy arrays and read by the modules in ui/stage. No models.

Arrays travel as base64 of little-endian float32, int16 or uint8. What the browser relies on is checked here; where
something does not fit, PlaygroundError says so in one sentence.
"""

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError
from playground.figures.colors import oklch_to_rgb, system_color
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22

VERSION = 1
ORIGINAL_ID = "original"
NOT_FRAMES = "latents are not frames by construction: a cell shows its share of time, not which frames it governs"
_MAX_CODES = 32_768  # ids travel as int16
_COLUMNS = 4 + 3 * (HUMAN22.size - 1)
Json = dict[str, Any]


def code_colors(codebook: ArrayLike) -> NDArray[np.uint8]:
    """Colours of a codebook [V, D] -> uint8 [V, 3]: near codes look near, equal codes are equal.

    First principal component to hue, second to lightness (both by rank, so that colours spread evenly), in OKLCH.
    Lightness stays between 0.62 and 0.86: it shows on a light and on a dark page, and dark digits read on all of it.
    PlaygroundError if the codebook is not a finite matrix.
    """
    codes = np.asarray(codebook, np.float64)
    if codes.ndim != 2 or not codes.size or not np.isfinite(codes).all():
        raise PlaygroundError(f"a codebook must be a finite matrix [codes, width], got {list(codes.shape)}")
    centred = codes - codes.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    axes = axes[:, ::-1][:, :2]
    strongest = np.abs(axes).argmax(axis=0)
    axes = axes * np.where(axes[strongest, np.arange(axes.shape[1])] < 0, -1.0, 1.0)
    places = [_rank(column) for column in (centred @ axes).T]
    first, second = places[0], places[1] if len(places) > 1 else np.full(len(codes), 0.5)
    return oklch_to_rgb(0.62 + 0.24 * second, np.full(len(codes), 0.125), np.deg2rad(25.0 + 305.0 * first))


def figure(
    id: str,
    name: str,
    joints: ArrayLike | None,
    system: str | None = None,
    caption: str = "",
    ghost_of: str | None = None,
    g: float | str | None = None,
    frames: int | None = None,
) -> Json:
    """One moving figure. joints [F, 22, 3] in metres, or None for a figure whose joints the browser recovers from the
    payload's features at guidance g (a number, or "live" to follow the slider); then frames says F.

    system None is the original; caption is the small text under the name, e.g. "MPJPE 31 mm"; ghost_of is the id of the
    figure drawn faintly behind this one on demand.
    """
    color = system_color(system)
    block: Json = {"id": id, "name": name, "system": system, "color": color.light, "dark_color": color.dark}
    block.update(caption=caption, ghost_of=ghost_of)
    if joints is None:
        if frames is None or frames < 1 or not (g == "live" or isinstance(g, int | float)):
            raise PlaygroundError(f'figure "{id}" needs joints, or a guidance (number or "live") with its frame count')
        return {**block, "frames": int(frames), "joints": None, "g": g}
    array = np.asarray(joints, np.float64)
    if array.ndim != 3 or array.shape[1:] != (HUMAN22.size, 3) or not len(array) or not np.isfinite(array).all():
        raise PlaygroundError(f'figure "{id}" needs finite joints [frames, {HUMAN22.size}, 3], got {list(array.shape)}')
    return {**block, "frames": len(array), "joints": _base64(array, "<f4"), "g": g}


def level(
    ids: ArrayLike | None,
    codes: int,
    colors: NDArray[np.uint8] | None = None,
    entropy: ArrayLike | None = None,
    size: int | None = None,
    spans: ArrayLike | None = None,
) -> Json:
    """One row of the score: ids [s] of a codebook with `codes` entries, its colours uint8 [codes, 3] from code_colors
    (None: by index), entropy [s] in nats, spans [s, 2] measured first and last+1 frame of each token.

    ids None with a size is a row that is still to come: it is drawn empty.
    """
    if ids is None:
        if size is None or size < 1:
            raise PlaygroundError("a level without ids needs its size")
        return {"size": int(size), "codes": int(codes), "ids": None, "colors": None, "entropy": None, "spans": None}
    row = np.asarray(ids)
    if row.ndim != 1 or not row.size or not np.issubdtype(row.dtype, np.integer):
        raise PlaygroundError(f"a level's ids must be a row of whole numbers, got shape {list(row.shape)}")
    if not 1 <= codes <= _MAX_CODES or row.min() < 0 or row.max() >= codes:
        raise PlaygroundError(f"a level's ids must lie in 0..{codes - 1}, and a codebook holds 1 to {_MAX_CODES} codes")
    palette = code_colors(np.arange(codes, dtype=np.float64)[:, None]) if colors is None else np.asarray(colors)
    if palette.shape != (codes, 3) or palette.dtype != np.uint8:
        raise PlaygroundError(f"a level of {codes} codes needs colours uint8 [{codes}, 3], got {list(palette.shape)}")
    return {
        "size": len(row),
        "codes": int(codes),
        "ids": _base64(row, "<i2"),
        "colors": _base64(palette[row], "u1"),
        "entropy": None if entropy is None else _base64(_row_of(entropy, (len(row),), "entropy"), "<f4"),
        "spans": None if spans is None else _base64(_row_of(spans, (len(row), 2), "spans"), "<i2"),
    }


def track(system: str, name: str, frames: int, levels: Sequence[Json], note: str = "") -> Json:
    """One system's rows, coarse first. frames is the length of the motion that they stand for; note goes to the header,
    e.g. NOT_FRAMES."""
    if frames < 1 or not levels:
        raise PlaygroundError(f'track "{name}" needs at least one frame and one level')
    color = system_color(system)
    block: Json = {"system": system, "name": name, "color": color.light, "dark_color": color.dark}
    return {**block, "frames": int(frames), "note": note, "levels": list(levels)}


def features(
    figure_id: str,
    conditional: ArrayLike,
    unconditional: ArrayLike,
    mean: ArrayLike,
    std: ArrayLike,
    guidance: float = 2.0,
) -> Json:
    """Both decodes of one motion, normalised [F, 67], with mean and std [67]: the browser blends them and recovers the
    joints (systems.md A1, A8). guidance is the slider's first value."""
    shape = np.asarray(conditional).shape
    if len(shape) != 2 or shape[1] != _COLUMNS:
        raise PlaygroundError(f"guidance needs features [frames, {_COLUMNS}], got {list(shape)}")
    block: Json = {"figure": figure_id, "guidance": float(guidance)}
    arrays = (("conditional", conditional, shape), ("unconditional", unconditional, shape))
    for key, value, expected in (*arrays, ("mean", mean, (_COLUMNS,)), ("std", std, (_COLUMNS,))):
        block[key] = _base64(_row_of(value, expected, key), "<f4")
    return block


def badge(kind: str, seconds: float | None = None, text: str = "") -> Json:
    """Whether the result was computed now ("live", with its time) or is a stored one ("stored")."""
    if kind not in ("live", "stored"):
        raise PlaygroundError(f'a badge is "live" or "stored", got "{kind}"')
    return {"kind": kind, "seconds": None if seconds is None else float(seconds), "text": text}


def payload(
    figures: Sequence[Json],
    tracks: Sequence[Json] = (),
    features: Json | None = None,
    badge: Json | None = None,
    fps: int = LIMITS.fps,
) -> Json:
    """The whole stage, checked. PlaygroundError if figures are none or too many, ids repeat or point nowhere."""
    ids = [block["id"] for block in figures]
    if not 1 <= len(ids) <= LIMITS.max_figures:
        raise PlaygroundError(f"a stage shows 1 to {LIMITS.max_figures} figures, got {len(ids)}")
    if len(set(ids)) != len(ids):
        raise PlaygroundError("two figures of one stage have the same id")
    for block in figures:
        if block["ghost_of"] is not None and block["ghost_of"] not in ids:
            raise PlaygroundError(
                f'the ghost of figure "{block["id"]}" is to be "{block["ghost_of"]}", which is not there'
            )
        if block["g"] is not None and features is None:
            raise PlaygroundError(f'figure "{block["id"]}" follows the guidance, but the stage has no features')
    if features is not None and features["figure"] not in ids:
        raise PlaygroundError(f'the features belong to figure "{features["figure"]}", which is not there')
    longest = max(block["frames"] for block in (*figures, *tracks))
    return {
        "version": VERSION,
        "fps": int(fps),
        "frames": longest,
        "skeleton": {"names": list(HUMAN22.joints), "parents": list(HUMAN22.parents)},
        "figures": list(figures),
        "tracks": list(tracks),
        "features": features,
        "badge": badge,
    }


def message(state: str, text: str) -> Json:
    """A stage in the state "loading" or "error" (the last result stays, dimmed or with one sentence) or "empty"."""
    if state not in ("loading", "error", "empty"):
        raise PlaygroundError(f'a stage message is "loading", "error" or "empty", got "{state}"')
    return {"version": VERSION, "state": state, "message": text}


def _rank(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place of each value among the distinct values, 0 to 1; 0.5 where all are equal."""
    spread = float(values.max() - values.min())
    if spread <= 1e-9 * max(1.0, float(np.abs(values).max())):
        return np.full(len(values), 0.5)
    distinct, inverse = np.unique(np.round(values / spread, 9), return_inverse=True)
    return np.asarray(inverse / (len(distinct) - 1), np.float64)


def _row_of(value: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    array = np.asarray(value, np.float64)
    if array.shape != tuple(shape) or not np.isfinite(array).all():
        raise PlaygroundError(f"{name} must be finite numbers of shape {list(shape)}, got {list(array.shape)}")
    return array


def _base64(array: NDArray[Any], dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array).astype(dtype).tobytes()).decode("ascii")
