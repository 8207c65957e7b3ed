"""What each scale adds: one motion decoded from scales 1 to n, from one scale only, or without one."""

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from playground.engine.checks import Check
from playground.findings import ScaleSet, ScaleStudy
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.results import Tokenized

if TYPE_CHECKING:
    from playground.runtime import Runtime


def scale_sets(kind: str, count: int) -> list[ScaleSet]:
    """Every set of one kind ("upto", "only", "without") for a system of `count` scales."""
    return [ScaleSet.of(f"{kind}:{scale}", count) for scale in range(1, count + 1)]


def study_scales(
    runtime: "Runtime", tokenized: Tokenized, sets: Sequence[ScaleSet], guidance: float, check: Check | None
) -> ScaleStudy:
    """Decode one motion from every set of scales, all of them together."""
    import torch

    from playground.probes import decode_many, shares, total

    began = time.perf_counter()
    frames, caption = tokenized.motion.frames, tokenized.caption
    parts = shares(runtime, tokenized.levels, frames)
    chosen = [[parts[n] for n in one.levels(len(parts))] or [torch.zeros_like(parts[0])] for one in sets]
    embeddings = torch.cat([total(kept) for kept in chosen])
    rows = runtime.normaliser.invert(decode_many(runtime, embeddings, frames, caption, guidance, check))
    motions = tuple(Motion(from_features67(one), caption=caption) for one in rows)
    return ScaleStudy(
        system=tokenized.system,
        checkpoint=tokenized.checkpoint,
        guidance=guidance,
        sets=tuple(sets),
        mpjpe_mm=np.array([mpjpe(tokenized.motion.joints, motion.joints) for motion in motions], np.float32),
        energy=tokenized.residual_energy,
        motions=motions,
        seconds=time.perf_counter() - began,
    )
