"""Read and write motions by a file's suffix. Whatever a file holds, what comes out is HUMAN22 at 20 fps, canonical.

| suffix | read | written |
|---|---|---|
| .bvh | any two-legged skeleton | HUMAN22, metres, Y up |
| .npz | joints [F, 22, 3] with fps, caption; AMASS-style joints, mocap_framerate; features | joints, fps, caption |
| .npy | joints [F, 22, 3] or [F, 66]; 67 or 263 HumanML3D columns, not normalised; 20 fps | |
| both | 296 SnapMoGen columns, or 148 with the rig's `offsets` [24, 3], not normalised; 30 fps | |
| .glb | | animated body |
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.arrays import Arrays, Header, open_arrays
from playground.motion.bvh import read_bvh, write_bvh
from playground.motion.features263 import COLUMNS263, from_features263
from playground.motion.gltf import write_glb
from playground.motion.kinematics import OFFSETS, bone_lengths, global_rotations, rotations_from_joints, unit
from playground.motion.motion import Motion
from playground.motion.representation import COLUMNS, from_features67
from playground.motion.retarget import retarget
from playground.motion.rotation import Array
from playground.motion.skeleton import HUMAN22
from playground.motion.snapmogen import COLUMNS as SNAPMOGEN
from playground.motion.snapmogen import FPS as SNAPMOGEN_FPS
from playground.motion.snapmogen import JOINTS as SNAPMOGEN_JOINTS
from playground.motion.snapmogen import source_of
from playground.motion.source import Source, check_size

READ = (".bvh", ".npy", ".npz")
WRITTEN = (".npz", ".bvh", ".glb")
JOINT_KEYS = ("joints", "jtr", "joints3d", "joint_positions", "positions", "keypoints3d", "features", "motion", "data")
RATE_KEYS = ("fps", "mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "mocap_fps")
POSE_KEYS = {"poses", "pose_body", "body_pose", "root_orient", "global_orient", "betas", "trans", "thetas"}
FLAT = (3 * HUMAN22.size, COLUMNS, COLUMNS263, *SNAPMOGEN)  # columns of a two-dimensional array: joints or features
SMPL_JOINTS = (24, 52, 55, 73)  # SMPL, SMPL-H, SMPL-X without and with more: the first 22 are HUMAN22's
MAX_SHARE_OF_DRIFT = 0.3  # standard deviation of a bone's length over its median, beyond which it is no bone


@dataclass(frozen=True, eq=False)
class ReadMotion:
    """A motion on HUMAN22 at 20 fps, canonical, of any accepted length, and what was done to get it."""

    motion: Motion
    mapping: str  # one sentence: which joint mapping was used
    changes: list[str]  # one clause each


def _suffix(path: Path, accepted: tuple[str, ...], verb: str) -> str:
    suffix = path.suffix.lower()
    if suffix not in accepted:
        shown = f"'{suffix[:12]}' files" if suffix else "files without a suffix"
        raise PlaygroundError(f"{shown} cannot be {verb}; {', '.join(accepted)} can")
    return suffix


def _check_file(path: Path) -> None:
    """PlaygroundError unless there is a file of 1 byte to 20 MB."""
    try:
        size = path.stat().st_size if path.is_file() else -1
    except OSError:
        size = -1
    if size < 0:
        raise PlaygroundError(f"there is no file '{path.name[:80]}'")
    if not size:
        raise PlaygroundError("the file is empty")
    if size > LIMITS.max_upload_bytes:
        limit = LIMITS.max_upload_bytes / 2**20
        raise PlaygroundError(f"the file has {size / 2**20:.1f} MB; at most {limit:.0f} MB are accepted")


def _rate(arrays: Arrays) -> float | None:
    """The frame rate that an npz states, None if it states none."""
    names = {name.lower(): name for name in arrays.headers}
    for key in RATE_KEYS:
        if key in names:
            header = arrays.headers[names[key]]
            if header.dtype.kind not in "fiu" or header.shape not in ((), (1,)):
                raise PlaygroundError(f"'{names[key]}' of the npz file must be one number, the frame rate")
            return float(arrays.values(names[key]).reshape(-1)[0])
    return None


def _caption(arrays: Arrays) -> str:
    header = arrays.headers.get("caption")
    if header is None or header.dtype.kind != "U" or header.shape not in ((), (1,)):
        return ""
    return str(arrays.values("caption").reshape(-1)[0])[: LIMITS.max_prompt_chars].strip()


def _shape(header: Header) -> tuple[int, ...]:
    """The shape of one motion: a leading 1, as models give it, left out."""
    shape = header.shape
    batch = len(shape) == 4 or (len(shape) == 3 and shape[2] in FLAT)
    return shape[1:] if batch and shape[0] == 1 else shape


def _is_motion(header: Header) -> bool:
    """Whether an array could be joints or features: [F, J, 3] or [F, one of FLAT]."""
    shape = _shape(header)
    return (len(shape) == 3 and shape[2] == 3) or (len(shape) == 2 and shape[1] in FLAT)


def _pick(arrays: Arrays) -> str:
    """The name of the array that holds the motion. PlaygroundError with what would be accepted."""
    if "" in arrays.headers:
        return ""
    names = {name.lower(): name for name in arrays.headers}
    for key in JOINT_KEYS:
        if key in names:
            return names[key]
    fitting = [name for name, header in arrays.headers.items() if _is_motion(header)]
    if len(fitting) == 1:
        return fitting[0]
    if POSE_KEYS & set(names):
        raise PlaygroundError(
            "this npz file holds SMPL pose parameters only, which need a body model to become joints; "
            "export the joint positions ('joints', frames x 22 x 3) and upload those"
        )
    listed = ", ".join(sorted(arrays.headers))[:80]
    raise PlaygroundError(f"the npz file needs an array 'joints' [frames, 22, 3]; it holds {listed}")


def _check_shape(header: Header, fps: float) -> tuple[int, ...]:
    """The shape without a leading 1. PlaygroundError unless it is one of the accepted ones, before anything is read."""
    shape = _shape(header)
    accepted = (
        f"joints [frames, 22, 3], {COLUMNS} or {COLUMNS263} HumanML3D columns or {SNAPMOGEN[1]} SnapMoGen columns are"
    )
    if header.dtype.kind not in "fiu":
        raise PlaygroundError(f"the array does not hold numbers; {accepted} accepted")
    if len(shape) == 3 and shape[2] == 3:
        check_size("array", shape[0], max(shape[1], 1), fps)
        if shape[1] not in (HUMAN22.size, *SMPL_JOINTS):
            raise PlaygroundError(
                f"the array has {shape[1]} joints; 22 in HumanML3D's order are accepted, or SMPL's 24, 52, 55 or 73"
            )
    elif len(shape) == 2 and shape[1] in FLAT:
        check_size("array", shape[0], HUMAN22.size, fps)
    else:
        raise PlaygroundError(f"the array has the shape {list(header.shape)[:6]}; {accepted} accepted")
    return shape


def _joints_of(values: NDArray[Any]) -> tuple[Array, str]:
    """An array of an accepted shape -> joints [F, 22, 3] in its own unit, and how it was understood."""
    values = values.astype(np.float64)
    if not np.isfinite(values).all() or np.abs(values).max() > 1e9:
        raise PlaygroundError("the array holds NaN, infinite or huge values; every value must be a finite number")
    if values.ndim == 3:
        joints, total = values[:, : HUMAN22.size], values.shape[1]
        if total == HUMAN22.size:
            return joints, "Joints were taken in HumanML3D's order."
        return joints, f"The first 22 of {total} joints were taken in SMPL's order, which is HumanML3D's."
    if values.shape[1] == 3 * HUMAN22.size:
        return values.reshape(len(values), HUMAN22.size, 3), "66 columns were taken as 22 joints in HumanML3D's order."
    recover = from_features67 if values.shape[1] == COLUMNS else from_features263
    joints = recover(values).astype(np.float64)
    leg = bone_lengths(joints)[:, [4, 5, 7, 8]].sum(axis=-1) / 2.0
    if not 0.4 < float(np.median(leg)) < 1.3 or float(np.std(leg)) > 0.2:
        raise PlaygroundError(
            f"the {values.shape[1]} columns do not give a human body in metres; "
            "HumanML3D features that are not normalised are needed"
        )
    return joints, f"Joints were recovered from {values.shape[1]} HumanML3D columns."


def _source(joints: Array, fps: float) -> Source:
    """Joints [F, 22, 3] of any size -> a source with rotations. PlaygroundError if they move like no skeleton."""
    lengths = bone_lengths(joints)[:, 1:]
    median = np.median(lengths, axis=0)
    drift = lengths.std(axis=0) / np.maximum(median, 1e-12)
    if median.min() < 1e-9 or float(np.median(drift)) > MAX_SHARE_OF_DRIFT:
        raise PlaygroundError(
            "the joints do not keep their distances, so they are no body in HumanML3D's joint order; "
            "22 joints, pelvis first, are accepted"
        )
    offsets = unit(OFFSETS) * np.concatenate([[0.0], median])[:, None]
    rotations = global_rotations(rotations_from_joints(joints, offsets))
    return Source(HUMAN22.joints, HUMAN22.parents, offsets, joints, rotations, fps, {}, "array", has_rest=False)


def _from_arrays(path: Path) -> tuple[Source, str, str, bool]:
    """An npy or npz file -> its source, how it was understood, its caption, whether Y is up for certain."""
    arrays = open_arrays(path)
    name = _pick(arrays)
    stated = _rate(arrays)
    fps = float(LIMITS.fps) if stated is None else stated
    shape = _check_shape(arrays.headers[name], fps)
    if shape[1] in SNAPMOGEN:
        source, sentence = _snapmogen(arrays, name, shape, stated)
        return source, sentence, _caption(arrays), True
    joints, sentence = _joints_of(arrays.values(name).reshape(shape))
    return _source(joints, fps), sentence, _caption(arrays), len(shape) == 2 and shape[1] != 3 * HUMAN22.size


def _snapmogen(arrays: Arrays, name: str, shape: tuple[int, ...], fps: float | None) -> tuple[Source, str]:
    """An array of SnapMoGen's columns -> its source on 24 joints, and how it was understood."""
    rows, offsets = arrays.values(name).reshape(shape).astype(np.float64), arrays.headers.get("offsets")
    rig = None
    if offsets is not None and offsets.shape == (SNAPMOGEN_JOINTS, 3) and offsets.dtype.kind == "f":
        rig = arrays.values("offsets").astype(np.float64)
    if rig is None and shape[1] == SNAPMOGEN[0]:
        raise PlaygroundError(
            f"{shape[1]} SnapMoGen columns need the rig: an npz file with them and 'offsets' [{SNAPMOGEN_JOINTS}, 3]"
        )
    if not np.isfinite(rows).all() or np.abs(rows).max() > 1e9 or (rig is not None and not np.isfinite(rig).all()):
        raise PlaygroundError("the array holds NaN, infinite or huge values; every value must be a finite number")
    source = source_of(rows, rig)
    return replace(source, fps=fps or SNAPMOGEN_FPS), f"24 joints were recovered from {shape[1]} SnapMoGen columns."


def read_snapmogen_rows(path: Path) -> Source:
    """An .npy or .npz file of SnapMoGen's columns -> its source on 24 joints. PlaygroundError for anything else."""
    _suffix(path, (".npy", ".npz"), "read as columns")
    _check_file(path)
    arrays = open_arrays(path)
    name = _pick(arrays)
    shape = _check_shape(arrays.headers[name], SNAPMOGEN_FPS)
    if shape[1] not in SNAPMOGEN:
        raise PlaygroundError(
            f"the array has {shape[1]} columns; SnapMoGen's {SNAPMOGEN[0]} or {SNAPMOGEN[1]} are read"
        )
    return _snapmogen(arrays, name, shape, _rate(arrays))[0]


def read_motion(path: str | Path, start_seconds: float = 0.0) -> ReadMotion:
    """A .bvh, .npy or .npz file -> HUMAN22 at 20 fps, canonical, from `start_seconds` on; not cut to any length.

    PlaygroundError with one sentence for everything that cannot be read (see `LIMITS` for sizes).
    """
    path = Path(path)
    suffix = _suffix(path, READ, "read")
    _check_file(path)
    caption = ""
    if suffix == ".bvh":
        result = retarget(read_bvh(path.read_bytes()), start_seconds)
        mapping = result.mapping
    else:
        source, mapping, caption, certain = _from_arrays(path)
        result = retarget(source, start_seconds, upright=certain)
    motion = Motion(result.joints, float(LIMITS.fps), HUMAN22, caption, path.stem)
    return ReadMotion(motion, mapping, result.changes)


def write_motion(motion: Motion, path: str | Path) -> list[str]:
    """Write a motion on HUMAN22 as .npz, .bvh or .glb; returns what had to be changed (bones set to the median).

    PlaygroundError for another suffix or skeleton, or where the file cannot be written.
    """
    path = Path(path)
    suffix = _suffix(path, WRITTEN, "written")
    changes: list[str] = []
    try:
        if suffix == ".npz":
            with path.open("wb") as file:
                fps, caption = np.float32(motion.fps), np.array(motion.caption)
                np.savez_compressed(file, joints=motion.joints, fps=fps, caption=caption)
        elif suffix == ".bvh":
            text, changes = write_bvh(motion)
            path.write_text(text, encoding="ascii", newline="\n")
        else:
            data, changes = write_glb(motion)
            path.write_bytes(data)
    except OSError as error:
        raise PlaygroundError(f"'{path.name[:80]}' cannot be written: {error.strerror or 'no access'}") from None
    return changes
