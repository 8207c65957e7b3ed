"""Losses on feet: toes as the recovery moves them, and standing toes alone."""

import numpy as np
import pytest
import torch

from playground.motion.measures import TOES
from playground.motion.representation import from_features67, to_features67
from playground.motion.synthetic import corpus
from playground.training.feet import TOE_COLUMNS, foot_loss, toe_steps


def test_the_steps_of_the_toes_are_those_of_the_recovered_motion():
    rows = np.stack([to_features67(clip.motion.joints)[:40] for clip in corpus(4, seed=3)])
    steps = toe_steps(torch.from_numpy(rows)).numpy()  # (B, F - 1, 2, 2)
    for row, found in zip(rows, steps, strict=True):
        toes = from_features67(row)[:, TOES][..., (0, 2)]
        assert np.linalg.norm(found, axis=-1) == pytest.approx(np.linalg.norm(np.diff(toes, axis=0), axis=-1), abs=1e-5)


def test_the_foot_loss_counts_standing_toes_alone():
    rows = torch.from_numpy(to_features67(corpus(1, seed=3)[0].motion.joints)[None, :30])
    lengths = torch.tensor([30])
    slid = rows.clone()
    slid[..., 1] += 0.01  # the body glides by 1 cm a frame
    flying, lifted = rows.clone(), slid.clone()
    for x in (flying, lifted):
        x[..., TOE_COLUMNS + 1] += 1.0
    assert float(foot_loss(rows, rows, lengths, 30.0)) == 0.0
    assert float(foot_loss(slid, rows, lengths, 30.0)) > 0.01
    assert float(foot_loss(lifted, flying, lengths, 30.0)) == 0.0
