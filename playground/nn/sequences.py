"""Sequences joined from parts: states, key masks (True where real) and rotary places, kept in step."""

import torch
from torch import Tensor


def put_before(
    parts: list[Tensor], masks: list[Tensor | None], places: list[Tensor], part: Tensor, mask: Tensor | None, room: int
) -> None:
    """Prepend a part to a sequence; it takes `room` positions, however long it is."""
    places[:] = [torch.arange(part.shape[1], device=part.device), *(place + room for place in places)]
    parts.insert(0, part)
    masks.insert(0, mask)


def join_masks(masks: list[Tensor | None], parts: list[Tensor]) -> Tensor | None:
    """Key masks of concatenated parts -> [B, S], or None where every part is full."""
    if all(mask is None for mask in masks):
        return None
    filled = [
        mask if mask is not None else torch.ones(part.shape[:2], dtype=torch.bool, device=part.device)
        for mask, part in zip(masks, parts, strict=True)
    ]
    return torch.cat(filled, dim=1)
