"""Source `motion-x`: Motion-X as published (body only), or in the folders that LG-Tok and HumanTOMATO keep it in.

    motion_data/smplx_322/SUBSET/ID.npy   float [F, 322], SMPL-X parameters, 30 fps; or
    vector_263/SUBSET/ID.npy              float [F, 263], HumanML3D's columns, 30 fps; or
    new_joint_vecs/SUBSET/ID.npy          float [F, 623], the same of 52 joints; or
    new_joints/SUBSET/ID.npy              float [F, 22 or more, 3], SMPL-X order, 30 fps
    texts/semantic_labels/SUBSET/ID.txt   one caption a line; or texts/SUBSET/ID.txt
    train.txt val.txt test.txt            ids SUBSET/ID, one a line; without them takes are split by a hash of the id

Of the SMPL-X parameters root, body pose and translation are used, on the playground's own bones: body shape, hands and
face are left out, and no body model is needed. Texts of the subset humanml are HumanML3D's, with spans in seconds.
Clips of fewer than 40 frames are left out; long ones stay (Table 7 of LG-Tok trains on their windows).
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.data.library import SPLITS, LibraryClip
from playground.data.sources.base import (
    Reading,
    check_ids,
    folder,
    library_clip,
    read_numbers,
    read_text,
    retargeted,
    split_of,
)
from playground.data.sources.humanml3d import Span, cut, item_id, read_captions
from playground.errors import PlaygroundError
from playground.motion.features263 import COLUMNS263
from playground.motion.kinematics import OFFSETS, PARENTS, forward_kinematics, global_rotations
from playground.motion.positions import source_of_positions
from playground.motion.representation import COLUMNS, from_features67
from playground.motion.rotation import rotvec_to_quaternion
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source

FPS = 30.0
SHORTEST = 40  # frames (A1)
FOLDERS = ("motion_data/smplx_322", "vector_263", "new_joint_vecs", "new_joints")
TEXTS = ("texts/semantic_labels", "texts")
SMPLX, TOMATO = 322, 623  # columns of SMPL-X parameters, of HumanTOMATO's features
Rows = NDArray[np.floating]
POSE, TRANSLATION = slice(0, 3 * HUMAN22.size), slice(309, 312)  # axis-angle of root and 21 joints; metres


def read_motion_x(root: Path | None) -> Reading:
    """PlaygroundError where motions or texts are missing, or a list names something outside of the folder."""
    root = folder(root)
    motions = next((root / name for name in FOLDERS if (root / name).is_dir()), None)
    texts = next((root / name for name in TEXTS if (root / name).is_dir()), None)
    if motions is None or texts is None:
        raise PlaygroundError(f"{root} is not Motion-X: a folder {' or '.join(FOLDERS)} and a folder texts are needed")
    lists = [split for split in SPLITS if (root / f"{split}.txt").is_file()]
    ids = [(split, id) for split in lists for id in read_text(root / f"{split}.txt").split("\n") if id.strip()]
    for split in lists:
        check_ids(root / f"{split}.txt", (id.strip() for name, id in ids if name == split))
    if not lists:
        found = sorted(path.relative_to(motions).with_suffix("").as_posix() for path in motions.rglob("*.npy"))
        ids = [(split_of(id), id) for id in found]
    if not ids:
        raise PlaygroundError(f"{root} names no clip: neither its lists nor {motions.name} hold one")
    left_out: Counter[str] = Counter()
    return Reading(len(ids), _clips(motions, texts, [(split, id.strip()) for split, id in ids], left_out), left_out)


def _clips(motions: Path, texts: Path, ids: list[tuple[str, str]], left_out: Counter[str]) -> Iterator[LibraryClip]:
    for split, id in ids:
        motion, text = motions / f"{id}.npy", texts / f"{id}.txt"
        if not motion.is_file() or not text.is_file():
            left_out["ids without a motion or a text file"] += 1
            continue
        spans = read_texts(text, left_out)
        if not spans:
            left_out["ids without a caption"] += 1
        rows = read_numbers(motion)
        check_shape(rows, motion)
        for span, captions in spans.items():
            part = cut(np.asarray(rows), span, FPS)
            if len(part) < SHORTEST:
                left_out[f"clips of fewer than {SHORTEST} frames"] += 1
                continue
            certain = part.ndim == 2 and part.shape[1] != SMPLX  # features have Y up
            joints = retargeted(part, source_of, left_out, upright=certain)
            if joints is None:
                continue
            clip = library_clip(
                joints,
                left_out,
                id=item_id(id, span),
                source="Motion-X",
                split=split,
                label=captions[0],
                captions=captions,
            )
            if clip:
                yield clip


def check_shape(rows: Rows, path: Path) -> None:
    """PlaygroundError unless the rows of a file have one of the published forms."""
    known = (SMPLX, COLUMNS, COLUMNS263, TOMATO)
    features = rows.ndim == 2 and rows.shape[1] in known
    if not features and not (rows.ndim == 3 and rows.shape[1] >= HUMAN22.size and rows.shape[2] == 3):
        raise PlaygroundError(
            f"{path} holds values {list(rows.shape)}; [frames, {SMPLX}], [frames, {COLUMNS263}], [frames, {TOMATO}] or"
            f" [frames, {HUMAN22.size} or more, 3] is needed"
        )


def source_of(rows: Rows) -> Source:
    """Rows in one of the published forms -> a source at 30 fps."""
    rows = np.array(rows, np.float64)
    if rows.ndim == 2 and rows.shape[1] == SMPLX:
        local = rotvec_to_quaternion(rows[:, POSE].reshape(len(rows), HUMAN22.size, 3))
        joints = forward_kinematics(local, rows[:, TRANSLATION])
        turned = global_rotations(local)
        return Source(HUMAN22.joints, PARENTS, OFFSETS, joints, turned, FPS, {}, "Motion-X motion")
    joints = from_features67(rows[:, :COLUMNS]) if rows.ndim == 2 else rows[:, : HUMAN22.size]
    return source_of_positions(joints, HUMAN22.joints, PARENTS, OFFSETS, FPS, "Motion-X motion")


def read_texts(path: Path, left_out: Counter[str]) -> dict[Span, tuple[str, ...]]:
    """The captions of one text by span: HumanML3D's lines, or plain ones for the whole clip; see read_captions."""
    lines = [line.strip() for line in read_text(path).splitlines() if line.strip()]
    if any(line.count("#") >= 3 for line in lines):
        return read_captions(path, left_out)
    return {(0.0, 0.0): tuple(lines)} if lines else {}
