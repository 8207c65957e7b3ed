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
from playground.figures.colors import code_colors, system_color
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22

VERSION = 1
ORIGINAL_ID = "original"
NOT_FRAMES = "latents are not frames by construction: a cell shows its share of time, not which frames it governs"
MAX_STRIP_ROWS = 96  # words of the longest prompt, or joints
_MAX_CODES = 32_768  # ids travel as int16
_COLUMNS = 4 + 3 * (HUMAN22.size - 1)
_SIDE = ("{}_collar", "{}_shoulder", "{}_elbow", "{}_wrist"), ("{}_hip", "{}_knee", "{}_ankle", "{}_foot")
BODY_PARTS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("head", ("head", "neck")),
    ("trunk", ("spine3", "spine2", "spine1", "pelvis")),
    *(
        (f"{side} {limb}", tuple(name.format(side[0]) for name in names))
        for limb, names in zip(("arm", "leg"), _SIDE, strict=True)
        for side in ("left", "right")
    ),
)
Json = dict[str, Any]


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
    marks: ArrayLike | None = None,
) -> Json:
    """One row of the score: ids [s] of a codebook with `codes` entries, its colours uint8 [codes, 3] from code_colors
    (None: by index), entropy [s] in nats, spans [s, 2] measured first and last+1 frame of each token, marks bool [s]
    of the tokens to be marked (the track says what for).

    ids None with a size is a row that is still to come: it is drawn empty.
    """
    if ids is None:
        if size is None or size < 1:
            raise PlaygroundError("a level without ids needs its size")
        nothing = dict.fromkeys(("ids", "colors", "entropy", "spans", "marks"))
        return {"size": int(size), "codes": int(codes), **nothing}
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
        "marks": None if marks is None else _base64(_row_of(marks, (len(row),), "marks") != 0, "u1"),
    }


def track(system: str, name: str, frames: int, levels: Sequence[Json], note: str = "", marked: str = "changed") -> Json:
    """One system's rows, coarse first. frames is the length of the motion that they stand for; note goes to the header,
    e.g. NOT_FRAMES; marked says in a few words what the marks of its levels mean."""
    if frames < 1 or not levels:
        raise PlaygroundError(f'track "{name}" needs at least one frame and one level')
    color = system_color(system)
    block: Json = {"system": system, "name": name, "color": color.light, "dark_color": color.dark}
    return {**block, "frames": int(frames), "note": note, "marked": marked, "levels": list(levels)}


def strip(
    id: str,
    name: str,
    unit: str,
    rows: Sequence[str],
    values: ArrayLike,
    max: float | None = None,
    groups: Sequence[tuple[str, int]] = (),
    joints: Sequence[int] = (),
) -> Json:
    """A heat map under the score, on its time axis: values [rows, frames], 0 or more, named rows, a unit ("" for a
    share), `max` for the end of the colour ramp (None: the largest value).

    groups: (name, rows) one after the other, for rows too many to be named one by one; joints: the joint of each row,
    which the figures light up when the row is pointed at.
    """
    array = np.asarray(values, np.float64)
    if array.ndim != 2 or array.shape[0] != len(rows) or not 1 <= len(rows) <= MAX_STRIP_ROWS or not array.shape[1]:
        raise PlaygroundError(
            f'strip "{name}" needs values [rows, frames] for 1 to {MAX_STRIP_ROWS} named rows, got '
            f"{list(array.shape)} for {len(rows)} names"
        )
    if not np.isfinite(array).all() or array.min() < 0 or (max is not None and not 0 < max < np.inf):
        raise PlaygroundError(f'strip "{name}" needs finite values of 0 or more, and a largest value above 0')
    if (groups and sum(count for _, count in groups) != len(rows)) or (joints and len(joints) != len(rows)):
        raise PlaygroundError(f'the groups and joints of strip "{name}" must cover its {len(rows)} rows')
    if any(not 0 <= joint < HUMAN22.size for joint in joints):
        raise PlaygroundError(f'the joints of strip "{name}" must lie in 0..{HUMAN22.size - 1}')
    return {
        "id": id,
        "name": name,
        "unit": unit,
        "rows": list(rows),
        "values": _base64(array, "<f4"),
        "max": float(max if max is not None else array.max() or 1.0),
        "groups": [[group, int(count)] for group, count in groups],
        "joints": [int(joint) for joint in joints],
    }


def joint_strip(id: str, name: str, difference: ArrayLike, max_mm: float | None = None) -> Json:
    """Joints-by-frames heat map of a difference [frames, 22] in metres: rows by body part, values in millimetres."""
    array = np.asarray(difference, np.float64)
    if array.ndim != 2 or array.shape[1] != HUMAN22.size:
        raise PlaygroundError(f'strip "{name}" needs a difference [frames, {HUMAN22.size}], got {list(array.shape)}')
    joints = [HUMAN22.index(joint) for _, members in BODY_PARTS for joint in members]
    names = [HUMAN22.joints[joint].replace("l_", "left ").replace("r_", "right ") for joint in joints]
    groups = [(part, len(members)) for part, members in BODY_PARTS]
    return strip(id, name, "mm", names, 1000 * array.T[joints], max_mm, groups, joints)


def spans_of(kept: ArrayLike) -> list[tuple[int, int]]:
    """Runs of True in a row of bools [frames] as (first, last+1): what payload() takes as hatch."""
    row = np.asarray(kept)
    if row.ndim != 1 or row.dtype != np.bool_:
        raise PlaygroundError(f"kept frames must be a row of true and false, got {row.dtype} {list(row.shape)}")
    edges = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]]).astype(np.int8)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


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


def growing(first: int, window: int, ahead: int, play: bool = False) -> Json:
    """What makes a payload a piece of a motion that grows: its first frame on a clock that runs on, the frames that the
    stage keeps at most, and the frames ahead of the playhead below which it asks for the next piece.

    A piece of the same scene that begins where the one before ended joins it; any other one begins anew and plays,
    where the visitor asks for calm with `play` only.
    """
    if first < 0 or not 1 <= ahead < window:
        raise PlaygroundError(
            f"a piece needs a first frame of 0 or more and 1 <= ahead < window, got {ahead}, {window}"
        )
    return {"first": int(first), "window": int(window), "ahead": int(ahead), "play": play}


def payload(
    figures: Sequence[Json],
    tracks: Sequence[Json] = (),
    features: Json | None = None,
    badge: Json | None = None,
    fps: int = LIMITS.fps,
    strips: Sequence[Json] = (),
    hatch: Sequence[tuple[int, int]] = (),
    hatched: str = "kept as it was",
    scene: str | None = None,
    growing: Json | None = None,
    ribbon: Sequence[tuple[int, str]] = (),
) -> Json:
    """The whole stage, checked. strips: heat maps under the score; hatch: spans (first, last+1 frame) that are hatched
    on timeline and score, and `hatched` what that means; scene: what is shown, in any words: clock and selection go on
    while it is the same and start anew with another (None: told by the figures); growing: of a piece of a motion that
    goes on; ribbon: (first frame, words) over the score, each until the next one.

    PlaygroundError if figures are none or too many, ids repeat or point nowhere, spans are not in order.
    """
    _check_figures(figures, features)
    longest = max(block["frames"] for block in (*figures, *tracks))
    if len({block["id"] for block in strips}) != len(strips):
        raise PlaygroundError("two strips of one stage have the same id")
    edges = [edge for span in hatch for edge in span]
    apart = all(len(span) == 2 for span in hatch) and edges == sorted(set(edges))
    if not apart or any(not 0 <= edge <= longest for edge in edges):
        raise PlaygroundError(f"hatched spans must be (first, last+1) in order and apart, within 0..{longest}")
    starts = [start for start, _ in ribbon]
    if starts != sorted(set(starts)):
        raise PlaygroundError("the words of a ribbon must begin one after the other")
    return {
        "version": VERSION,
        "fps": int(fps),
        "frames": longest,
        "skeleton": {"names": list(HUMAN22.joints), "parents": list(HUMAN22.parents)},
        "figures": list(figures),
        "tracks": list(tracks),
        "features": features,
        "badge": badge,
        "strips": list(strips),
        "hatch": [[int(start), int(stop)] for start, stop in hatch],
        "hatched": hatched,
        "scene": scene,
        "growing": growing,
        "ribbon": [[int(start), text] for start, text in ribbon],
    }


def _check_figures(figures: Sequence[Json], features: Json | None) -> None:
    """PlaygroundError where figures or features cannot stand on one stage."""
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


def message(state: str, text: str) -> Json:
    """A stage in the state "loading" or "error" (the last result stays, dimmed or with one sentence) or "empty"."""
    if state not in ("loading", "error", "empty"):
        raise PlaygroundError(f'a stage message is "loading", "error" or "empty", got "{state}"')
    return {"version": VERSION, "state": state, "message": text}


def _row_of(value: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    array = np.asarray(value, np.float64)
    if array.shape != tuple(shape) or not np.isfinite(array).all():
        raise PlaygroundError(f"{name} must be finite numbers of shape {list(shape)}, got {list(array.shape)}")
    return array


def _base64(array: NDArray[Any], dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array).astype(dtype).tobytes()).decode("ascii")
