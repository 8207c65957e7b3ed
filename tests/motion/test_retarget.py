"""Retargeting: whatever skeleton, unit, axes, rate or zero pose a file has, the same motion comes out."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from playground.errors import PlaygroundError
from playground.motion.bvh import read_bvh
from playground.motion.kinematics import LEGS, bone_lengths
from playground.motion.representation import canonicalise, heading
from playground.motion.retarget import Retargeted, retarget
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source
from playground.motion.synthetic import synthesise
from tests.motion.skeletons import NONSENSE, STYLES, Rig, bvh_text, walk

Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # playground axes -> a world whose Z points up
IK = STYLES["HumanIK"]


def through(joints: np.ndarray, rig: Rig, start: float = 0.0) -> Retargeted:
    return retarget(read_bvh(bvh_text(joints, rig).encode()), start)


def error(result: Retargeted, joints: np.ndarray) -> float:
    """Mean joint error in metres after both were put on the same start."""
    assert result.joints.shape == joints.shape and result.joints.dtype == np.float32
    return float(np.linalg.norm(result.joints - canonicalise(joints), axis=-1).mean())


@pytest.mark.parametrize("style", list(STYLES))
def test_the_same_motion_comes_out_of_every_style(style: str) -> None:
    joints = walk()[:40]
    result = through(joints, Rig(STYLES[style]))
    assert error(result, joints) < 0.006 and style in result.mapping
    assert np.allclose(bone_lengths(result.joints), HUMAN22.bone_lengths, atol=1e-5)


@pytest.mark.parametrize(
    ("unit", "word"),
    [(1.0, "metres"), (100.0, "centimetres"), (1000.0, "millimetres"), (1 / 0.0254, "inches"), (17.7165, "5.6 cm"),
     (1 / 0.3048, "feet"), (7e4, "unknown unit"), (0.001, "unknown unit")],
)  # fmt: skip
def test_units_are_recognised(unit: float, word: str) -> None:
    joints = walk()[:20]
    result = through(joints, Rig(IK, unit=unit))
    assert error(result, joints) < 0.02 and any(word in change for change in result.changes)


@pytest.mark.parametrize("axes", [Z_UP, Rotation.from_euler("X", 180, degrees=True).as_matrix(),
                                  Rotation.from_euler("Z", 90, degrees=True).as_matrix()])  # fmt: skip
def test_other_axes_are_turned_upright(axes: np.ndarray) -> None:
    joints = walk()[:30]
    result = through(joints, Rig(IK, axes=axes))
    assert error(result, joints) < 0.006 and any("points up in the file" in change for change in result.changes)


def test_a_heading_is_no_other_axis() -> None:
    joints = walk()[:30]
    result = through(joints, Rig(IK, axes=Rotation.from_euler("Y", 130, degrees=True).as_matrix()))
    assert error(result, joints) < 0.006 and not any("points up" in change for change in result.changes)


@pytest.mark.parametrize("fps", [30, 60, 100, 120])
def test_other_frame_rates_are_resampled(fps: int) -> None:
    joints = walk()
    time = np.arange(0.0, (len(joints) - 1) / 20.0, 1.0 / fps)
    at = time * 20.0
    low = np.minimum(at.astype(int), len(joints) - 2)
    fast = joints[low] + (joints[low + 1] - joints[low]) * (at - low)[:, None, None]
    result = through(fast[: 4 * fps], Rig(IK, fps=fps))
    wanted = joints[: len(result.joints)]
    assert len(wanted) == 80 if fps % 20 == 0 else len(wanted) in (79, 80)
    assert error(result, wanted) < 0.012 and any("resampled" in change for change in result.changes)


@pytest.mark.parametrize("seed", range(5))
def test_zero_poses_that_are_no_t_pose(seed: int) -> None:
    """Every joint has axes of its own, as where all bones lie along X: the pelvis may be off by the spine's tilt."""
    joints = walk()[:30]
    turns = Rotation.random(22, rng=np.random.default_rng(seed))
    result = through(joints, Rig(STYLES["Bandai Namco"], zero_pose=turns, positions_everywhere=True))
    assert error(result, joints) < 0.05
    turn = heading(result.joints, smooth=False) - heading(canonicalise(joints), smooth=False)
    assert np.abs(turn).max() < np.radians(4.0)


def test_nonsense_names_give_the_same_motion_and_say_so() -> None:
    joints = walk()[:30]
    result = through(joints, Rig(NONSENSE, axes=Z_UP))
    assert error(result, joints) < 0.006 and "shape of the hierarchy" in result.mapping


def test_a_skeleton_without_toes_hands_and_head_still_moves() -> None:
    joints = walk()[:40]
    result = through(joints, Rig(IK, drop=("l_foot", "r_foot", "l_wrist", "r_wrist", "head")))
    assert error(result, joints) < 0.03
    assert np.allclose(bone_lengths(result.joints), HUMAN22.bone_lengths, atol=1e-5)


def test_other_proportions_land_on_the_reference_bones_with_standing_feet() -> None:
    joints = synthesise("walk", np.random.default_rng(5), speed=1.2).motion.joints
    text = bvh_text(joints, Rig(IK))
    source = read_bvh(text.encode())
    longer = [n for n, name in enumerate(source.names) if "Arm" in name or "Spine" in name]
    offsets = source.offsets.copy()
    offsets[longer] *= 1.25
    stretched = text
    for n in longer:
        before = "OFFSET\t" + "\t".join(f"{v:.7f}" for v in source.offsets[n])
        stretched = stretched.replace(before, "OFFSET\t" + "\t".join(f"{v:.7f}" for v in offsets[n]))
    result = retarget(read_bvh(stretched.encode()))
    assert np.allclose(bone_lengths(result.joints), HUMAN22.bone_lengths, atol=1e-5)
    for _, _, ankle, foot in LEGS:
        for joint in (ankle, foot):
            still = np.linalg.norm(np.diff(joints[:, joint], axis=0), axis=-1) < 0.002
            assert still.sum() > 5
            assert np.linalg.norm(np.diff(result.joints[:, joint], axis=0), axis=-1)[still].max() < 0.008


def test_planted_feet_lie_flat_whatever_the_shape_of_the_source_foot() -> None:
    joints = synthesise("walk", np.random.default_rng(5), speed=1.2).motion.joints
    text = bvh_text(joints, Rig(IK))
    for foot in (10, 11):  # a foot whose toe joint lies level with the ankle
        x, _, z = (100 * v for v in HUMAN22.offsets[foot])
        old = "OFFSET\t" + "\t".join(f"{100 * v:.7f}" for v in HUMAN22.offsets[foot])
        assert old in text
        text = text.replace(old, f"OFFSET\t{x:.7f}\t0.0\t{z:.7f}")
    result = retarget(read_bvh(text.encode()))
    for _, _, ankle, foot in LEGS:
        still = np.linalg.norm(np.diff(joints[:, [ankle, foot]], axis=0), axis=-1).max(axis=-1) < 0.002
        assert still.sum() > 5
        drop = (result.joints[:-1, ankle] - result.joints[:-1, foot])[still, 1]
        assert np.allclose(drop, -HUMAN22.offsets[foot][1], atol=0.012)
        assert (result.joints[:-1, foot, 1][still] < 0.03).all()


def test_knees_bend_forwards() -> None:
    result = through(walk()[:40], Rig(IK))
    for hip, knee, ankle, _ in LEGS:
        middle = (result.joints[:, hip] + result.joints[:, ankle]) / 2.0
        across = result.joints[:, 1] - result.joints[:, 2]
        forward = np.stack([-across[:, 2], 0 * across[:, 0], across[:, 0]], axis=-1)
        assert (np.sum((result.joints[:, knee] - middle) * forward, axis=-1) > -0.002).all()


def test_a_t_pose_before_the_take_is_left_out() -> None:
    joints = walk()[:40]
    rest = np.zeros((1, 22, 3))
    for j in range(1, 22):
        rest[:, j] = rest[:, HUMAN22.parents[j]] + HUMAN22.offsets[j]
    taken = np.repeat(joints, 6, axis=0)
    taken = taken[:-1] + (taken[1:] - taken[:-1]) * 0.0
    result = through(np.concatenate([rest + taken[0, 0], taken]), Rig(STYLES["CMU"], fps=120))
    assert any("jumps" in change for change in result.changes)
    assert error(result, joints[: len(result.joints)]) < 0.006


def test_left_handed_axes_are_mirrored_back() -> None:
    joints = walk()[:30]
    source = read_bvh(bvh_text(joints, Rig(IK)).encode()).mirrored()
    result = retarget(source)
    assert any("left-handed" in change for change in result.changes)
    assert error(result, joints) < 0.006


def test_the_start_cuts_and_puts_the_rest_on_the_origin() -> None:
    joints = walk()
    result = through(joints, Rig(IK), start=1.0)
    assert error(result, joints[20:]) < 0.006
    assert np.abs(result.joints[0, 0, [0, 2]]).max() < 1e-6 and result.joints[..., 1].min() == pytest.approx(
        0.0, abs=1e-6
    )
    assert abs(heading(result.joints[:1], smooth=False)[0]) < 1e-5


def test_the_playgrounds_own_joints_are_not_touched() -> None:
    joints = walk()
    result = through(joints, Rig({name: name for name in HUMAN22.joints}, unit=1.0))
    assert np.abs(result.joints - joints).max() < 1e-4 and not result.changes


@pytest.mark.parametrize("start", [-1.0, 500.0])
def test_a_start_outside_is_refused(start: float) -> None:
    with pytest.raises(PlaygroundError, match="not inside the clip"):
        through(walk()[:30], Rig(IK), start)


def test_a_flight_beyond_the_limit_is_refused() -> None:
    joints = walk()[:30].copy()
    joints[15:] += [0.0, 0.0, 900.0]
    with pytest.raises(PlaygroundError, match="200 m"):
        through(joints, Rig(IK))


def test_a_collapsed_skeleton_is_refused() -> None:
    source = read_bvh(bvh_text(walk()[:10], Rig(IK)).encode())
    flat = Source(source.names, source.parents, source.offsets * 0, source.positions * 0, source.rotations, 20.0)
    with pytest.raises(PlaygroundError, match="legs of this skeleton"):
        retarget(flat)


@pytest.mark.parametrize("action", ["sit", "bow", "kick", "squat", "raise_hand"])
def test_other_actions_come_through(action: str) -> None:
    joints = synthesise(action, np.random.default_rng(2)).motion.joints[:60]
    assert error(through(joints, Rig(IK)), joints) < 0.01


def random_file(seed: int) -> str:
    """A BVH file of a random tree with random bones and random angles; some names are a body's."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 40))
    parents = [-1, *(int(rng.integers(max(0, k - 4), k)) for k in range(1, count))]
    offsets = rng.normal(size=(count, 3)) * 10 * (rng.random((count, 1)) > rng.choice([0.0, 0.4]))
    words = [*IK.values(), "Spine7", "x"]
    rng.shuffle(words)
    lines: list[str] = ["HIERARCHY"]

    def write(j: int) -> None:
        name = words[j] if j < len(words) and seed % 3 else f"j{j}"
        place = "6 Xposition Yposition Zposition" if j == 0 else "3"
        lines.extend([f"{'JOINT' if j else 'ROOT'} {name} {{", "OFFSET " + " ".join(f"{v:f}" for v in offsets[j])])
        lines.append(f"CHANNELS {place} Zrotation Xrotation Yrotation")
        kids = [c for c in range(count) if parents[c] == j]
        for c in kids:
            write(c)
        lines.extend([] if kids else [f"End Site {{\nOFFSET 0 {rng.integers(0, 2)} 0\n}}"])
        lines.append("}")

    write(0)
    frames, size = int(rng.integers(4, 9)), float(rng.choice([0.0, 1.0, 90.0, 1e6]))
    rows = [" ".join(f"{v:f}" for v in row) for row in rng.normal(size=(frames, 3 * count + 3)) * size]
    return "\n".join([*lines, "MOTION", f"Frames: {frames}", f"Frame Time: {rng.choice([0.05, 0.01, 0.3])}", *rows])


@pytest.mark.parametrize("block", range(4))
@pytest.mark.filterwarnings("error")
def test_random_skeletons_end_in_a_motion_or_a_sentence(block: int) -> None:
    for seed in range(30 * block, 30 * block + 30):
        try:
            result = retarget(read_bvh(random_file(seed).encode()))
        except PlaygroundError as error:
            assert "\n" not in str(error)
        else:
            assert np.isfinite(result.joints).all() and np.abs(result.joints).max() <= 200.0
