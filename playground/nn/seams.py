"""Seams between patches: a few convolutions along the frames that a detokenizer gave out patch by patch. Ours.

A detokenizer with patches gives every motion token's frames out at once and on their own, so that drawn tokens, a
little inconsistent with each other, make a motion jump from patch to patch. These convolutions see nine frames and add
a correction to the one in the middle; untrained, they add nothing.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.nn.linear import Conv3
from playground.nn.modules import module_list


class Seams(nn.Module):
    """columns: width of a frame; width: of what is between; patch: frames a motion token."""

    def __init__(self, columns: int, width: int, patch: int, depth: int = 4) -> None:
        super().__init__()
        widths = [columns, *(depth - 1) * [width], columns]
        self.layers = module_list(Conv3(i, o) for i, o in zip(widths, widths[1:], strict=False))
        self.places = nn.Parameter(torch.zeros(patch, width))  # where in its patch a frame stands
        for weight in self.layers[-1].parameters():
            nn.init.zeros_(weight)

    def forward(self, motion: Tensor, real: Tensor | None) -> Tensor:
        """motion [B, F, C] with its first frame at the start of a patch, real bool [B, F, 1] or None -> [B, F, C].

        Frames that are not real are not seen by those that are.
        """
        frames = motion.shape[1]
        places = self.places.repeat(-(-frames // len(self.places)), 1)[:frames]
        x = motion
        for number, layer in enumerate(self.layers):
            x = layer(x if real is None else x * real)
            if number == 0:
                x = x + places.to(x.dtype)
            if number + 1 < len(self.layers):
                x = F.gelu(x)
        return motion + x
