"""Losses on feet: how fast toes that stand move over the ground, from feature rows."""

import torch
from torch import Tensor
from torch.nn import functional as F

from playground.motion.measures import CONTACT_HEIGHT, TOES

TOE_COLUMNS = torch.tensor([4 + 3 * (toe - 1) for toe in TOES])  # x of each toe; y and z follow


def foot_loss(out: Tensor, features: Tensor, lengths: Tensor, mean_frames: float) -> Tensor:
    """smoothL1 in cm a frame between the horizontal speeds of the toes in out and features [B, F, 67] (metres,
    radians), weighted by how near the ground the true toe is (the weight of motion/measures.foot_sliding); scalar."""
    inside = torch.arange(1, features.shape[1], device=lengths.device)[None] < lengths[:, None]
    heights = features[..., TOE_COLUMNS + 1]  # (B, F, 2)
    height = torch.maximum(heights[:, 1:], heights[:, :-1]).clamp(0.0, CONTACT_HEIGHT)
    weight = (2.0 - 2.0 ** (height / CONTACT_HEIGHT)) * inside[..., None]
    away = (toe_steps(out) - toe_steps(features)) * 100.0
    error = F.smooth_l1_loss(away, torch.zeros_like(away), reduction="none", beta=0.2).mean(dim=-1)
    return (error * weight).sum() / (2 * mean_frames)


def toe_steps(features: Tensor) -> Tensor:
    """How far the toes move over the ground between frames, seen from the later frame's heading: rows [B, F, 67] in
    metres and radians -> [B, F - 1, 2 toes, x and z] (the recovery of systems.md A1, one step of it)."""
    turn = 2 * features[:, :-1, 0, None]  # (B, F - 1, 1): column 0 is half the yaw
    x, z = features[..., TOE_COLUMNS], features[..., TOE_COLUMNS + 2]
    before_x = x[:, :-1] * turn.cos() + z[:, :-1] * turn.sin()
    before_z = z[:, :-1] * turn.cos() - x[:, :-1] * turn.sin()
    root = features[:, :-1, 1:3]
    return torch.stack([x[:, 1:] - before_x + root[..., :1], z[:, 1:] - before_z + root[..., 1:]], dim=-1)
