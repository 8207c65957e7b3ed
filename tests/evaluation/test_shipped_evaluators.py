"""The shipped evaluators: small, telling their figures, and right about motions that they never saw."""

import numpy as np
import pytest

from playground.evaluation.evaluators import EVALUATORS, Evaluator, evaluator_path, load_evaluator
from playground.evaluation.retrieval import retrieval_lines
from playground.motion.representation import mirror_joints
from playground.motion.synthetic import Synthetic, corpus

NAMES = sorted(EVALUATORS)


@pytest.fixture(scope="module")
def items() -> list[Synthetic]:
    """60 parametric motions, none of them trained on."""
    return corpus(60, seed=1)


@pytest.fixture(params=NAMES)
def evaluator(request) -> Evaluator:
    return load_evaluator(request.param)


def test_files_are_small_and_state_what_they_reach(evaluator):
    assert evaluator_path(evaluator.name).stat().st_size < 8e6
    assert evaluator is load_evaluator(evaluator.name) and len(evaluator.hash) == 64
    table = evaluator.facts["retrieval"]["pool32"]
    assert evaluator.facts["split"] == "test" and evaluator.facts["retrieval"]["n"] > 400
    for top in ("top1", "top2", "top3"):
        own, same, ceiling = (table[key][top]["mean"] for key in ("own", "same_caption", "ceiling_caption"))
        assert own <= same <= 1.0 and own <= ceiling
    assert table["own"]["top3"]["mean"] >= 0.80
    assert len(retrieval_lines(evaluator.facts["retrieval"])) == 10


def test_synthetic_motions_are_found_by_their_captions(evaluator, items):
    """Guessing would put 5 % of them among the first three."""
    motions = evaluator.embed_motions([item.motion.joints for item in items])
    texts = evaluator.embed_texts([item.captions[0] for item in items])
    distances = np.linalg.norm(texts[:, None] - motions[None], axis=-1)
    rank = (distances < np.diag(distances)[:, None]).sum(axis=1)
    assert (rank < 3).mean() > 0.45


def test_left_is_not_right(evaluator, items):
    items = [item for item in items if item.action == "turn_walk"]
    assert len(items) > 4
    texts = evaluator.embed_texts([item.captions[0] for item in items])
    own = evaluator.embed_motions([item.motion.joints for item in items])
    mirrored = evaluator.embed_motions([mirror_joints(item.motion.joints) for item in items])
    assert np.mean((texts * own).sum(1) > (texts * mirrored).sum(1)) > 0.8
