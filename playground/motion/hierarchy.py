"""Which joint is which in a skeleton of unknown names: two legs, a spine, two arms and a head found by their shape.

A limb is a pair of branches of one joint with the same bone lengths. The pair nearer to the root is the legs. Left and
right come from the names where they say so, else from the direction in which the feet point.
"""

from dataclasses import dataclass

import numpy as np

from playground.errors import PlaygroundError
from playground.motion.rotation import Array
from playground.motion.source import Source

LEG = ("hip", "knee", "ankle", "foot")
ARM = ("shoulder", "elbow", "wrist")


@dataclass(frozen=True)
class _Pair:
    node: int
    branches: tuple[int, int]
    reach: float  # length of the longer branch


def ancestors(source: Source, joint: int) -> list[int]:
    """The joint and all joints above it, nearest first."""
    found = []
    while joint >= 0:
        found.append(joint)
        joint = source.parents[joint]
    return found


def meeting(source: Source, a: int, b: int) -> int:
    """The lowest joint that is above (or is) both a and b."""
    above = set(ancestors(source, a))
    return next(joint for joint in ancestors(source, b) if joint in above)


def _lengths(source: Source) -> Array:
    """Bone length [J] to the parent, median over the clip, so that animated offsets count too."""
    lengths = np.zeros(len(source.names))
    for joint, parent in enumerate(source.parents):
        if parent >= 0:
            bone = source.positions[:, joint] - source.positions[:, parent]
            lengths[joint] = np.median(np.linalg.norm(bone, axis=-1))
    return lengths


def _chains(source: Source, lengths: Array) -> list[list[int]]:
    """For every joint the longest way down from it, the joint first."""
    chains: list[list[int]] = [[] for _ in source.names]
    reach = np.zeros(len(source.names))
    for joint in reversed(range(len(source.names))):
        kids = source.children[joint]
        if kids:
            best = max(kids, key=lambda kid: reach[kid] + lengths[kid])
            reach[joint] = reach[best] + lengths[best]
            chains[joint] = [joint, *chains[best]]
        else:
            chains[joint] = [joint]
    return chains


def _alike(lengths: Array, a: list[int], b: list[int]) -> bool:
    """True if the first bones of two chains have the same lengths to within a tenth."""
    if min(len(a), len(b)) < 2 or abs(len(a) - len(b)) > 2:
        return False
    pairs = [(float(lengths[i]), float(lengths[j])) for i, j in zip(a[1:5], b[1:5], strict=False)]
    total = sum(max(pair) for pair in pairs)
    return total > 1e-9 and sum(abs(x - y) for x, y in pairs) < 0.1 * total


def _pairs(source: Source, lengths: Array, chains: list[list[int]]) -> list[_Pair]:
    """Twin branches, longest first; branches inside a longer pair (fingers, eyes) are left out."""
    found = []
    for node, kids in enumerate(source.children):
        for n, a in enumerate(kids):
            for b in kids[n + 1 :]:
                if _alike(lengths, chains[a], chains[b]):
                    reach = max(float(lengths[chains[kid][1:]].sum()) for kid in (a, b))
                    found.append(_Pair(node, (a, b), reach))
    kept: list[_Pair] = []
    for pair in sorted(found, key=lambda p: -p.reach):
        above = set(ancestors(source, pair.node))
        if not any(above & set(other.branches) or set(pair.branches) & set(other.branches) for other in kept):
            kept.append(pair)
    return kept


def _limbs(source: Source, lengths: Array, branches: list[list[int]], arms: bool) -> list[tuple[list[int], int | None]]:
    """Two twin chains -> for each the joints from shoulder or hip on, and the collar before it if there is one.

    Legs begin where the two longest neighbouring bones do; arms where the two sides are as far apart as a shoulder is.
    """
    longest = max(float(lengths[chain[1:]].max()) for chain in branches)
    chains = [[chain[0], *(j for j in chain[1:] if lengths[j] > 0.02 * longest)] for chain in branches]
    size = min(map(len, chains))
    if size < 3:
        raise PlaygroundError("a limb of the skeleton has fewer than two bones; arms and legs need two each")
    sums = [float(lengths[chains[0][i + 1]] + lengths[chains[0][i + 2]]) for i in range(size - 2)]
    start = int(np.argmax(sums))
    if arms:
        apart = [
            float(np.median(np.linalg.norm(source.positions[:, a] - source.positions[:, b], axis=-1)))
            for a, b in zip(*chains, strict=False)
        ]
        start = next((i for i in range(size - 2) if apart[i] >= 0.75 * longest), start)
    return [(chain[start:], chain[start - 1] if start else None) for chain in chains]


def _left_first(
    source: Source, legs: list[list[int]], arms: list[list[int]], side: dict[int, str]
) -> tuple[bool, bool]:
    """Whether the first leg and the first arm are the left ones."""
    p = source.positions
    middle = (p[:, legs[0][0]] + p[:, legs[1][0]]) / 2.0
    up = (p[:, arms[0][0]] + p[:, arms[1][0]]) / 2.0 - middle
    if all(len(leg) > 3 for leg in legs):
        forward = sum(p[:, leg[3]] - p[:, leg[2]] for leg in legs)
    else:  # knees bend to the front
        forward = sum(p[:, leg[1]] - (p[:, leg[0]] + p[:, leg[2]]) / 2.0 for leg in legs)
    left = np.cross(up, forward)
    answers = []
    for first, second in (legs, arms):
        names = {side.get(j, "") for j in first[:3]} - {""}, {side.get(j, "") for j in second[:3]} - {""}
        if names[0] != names[1] and len(names[0] | names[1]) == 2:
            answers.append("l" in names[0] or "r" in names[1])
        else:
            across = p[:, first[0]] - p[:, second[0]]
            answers.append(float(np.median(np.sum(across * left, axis=-1))) > 0.0)
    return answers[0], answers[1]


def by_shape(source: Source, side: dict[int, str]) -> dict[str, int]:
    """HUMAN22 joint names -> joints of a source, as far as they exist.

    side: "l" or "r" of joints whose names say so. PlaygroundError if no two legs and two arms can be found.
    """
    lengths = _lengths(source)
    chains = _chains(source, lengths)
    pairs = [pair for pair in _pairs(source, lengths, chains) if all(len(chains[b]) > 2 for b in pair.branches)]
    if len(pairs) < 2:
        raise PlaygroundError(
            "this skeleton is not understood: its joint names are of no known style, and two legs, a spine and two "
            "arms of matching lengths were not found either"
        )
    first, second = pairs[:2]
    legs_first = first.node in ancestors(source, second.node)
    leg_pair, arm_pair = (first, second) if legs_first else (second, first)
    roles: dict[str, int] = {}
    legs = [chain for chain, _ in _limbs(source, lengths, [chains[b] for b in leg_pair.branches], arms=False)]
    limbs = _limbs(source, lengths, [chains[b] for b in arm_pair.branches], arms=True)
    left_leg, left_arm = _left_first(source, legs, [chain for chain, _ in limbs], side)
    for chain, letter in zip(legs, "lr" if left_leg else "rl", strict=True):
        roles |= {f"{letter}_{role}": joint for role, joint in zip(LEG, chain, strict=False)}
    for (chain, collar), letter in zip(limbs, "lr" if left_arm else "rl", strict=True):
        roles |= {f"{letter}_{role}": joint for role, joint in zip(ARM, chain, strict=False)}
        if collar is not None:
            roles[f"{letter}_collar"] = collar
    rest = [kid for kid in source.children[arm_pair.node] if kid not in arm_pair.branches]
    if rest:
        up = chains[max(rest, key=lambda kid: float(lengths[chains[kid]].sum()))]
        up = [joint for joint in up if lengths[joint] > 0.02 * leg_pair.reach] or up
        roles |= dict(zip(("neck", "head"), up, strict=False))
    return roles
