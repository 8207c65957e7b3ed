"""The root refiner: how the body moves over the ground, read off its own movement (systems.md E1, after SnapMoGen).

A small convolutional network sees where the joints are relative to the root, columns 3 to 66, and says how the root
must have turned and moved, columns 0 to 2. A standing foot goes back in the body's frame as fast as the body goes on,
so what it says keeps standing feet where they are. It never sees the columns that it predicts: whatever drift a
generator left in them cannot leak through.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.motion.representation import COLUMNS
from playground.nn.convolutions import GROWTH, DilatedBlock, clip, conv
from playground.nn.modules import module_list

ROOT = 3  # columns that are predicted: half the yaw increment, root velocity x and z
SLOPE = 0.2  # of LeakyReLU below 0


@dataclass(frozen=True)
class RefinerConfig:
    """Every number of the refiner; the defaults are the shipped ones."""

    columns: int = COLUMNS
    width: int = 192
    blocks: int = 3  # residual blocks, with dilations 9, 3, 1: 15 frames are seen to either side
    dropout: float = 0.0


class RootRefiner(nn.Module):
    """Convolution of kernel 3, LeakyReLU, residual blocks, convolution of kernel 3."""

    def __init__(self, config: RefinerConfig) -> None:
        super().__init__()
        self.config = config
        self.stem = conv(config.columns - ROOT, config.width)
        dilations = [GROWTH**n for n in reversed(range(config.blocks))]
        self.blocks = module_list(DilatedBlock(config.width, dilation, config.dropout) for dilation in dilations)
        self.head = conv(config.width, ROOT)

    def forward(self, features: Tensor, lengths: Tensor) -> Tensor:
        """Normalised rows [B, F, columns], lengths [B] -> normalised root columns [B, F, 3], 0 beyond each length."""
        mask = (torch.arange(features.shape[1], device=lengths.device)[None] < lengths[:, None])[:, None]
        x = torch.where(mask, features[..., ROOT:].transpose(1, 2), 0.0)
        x = clip(F.leaky_relu(self.stem(x), SLOPE), mask)
        for block in self.blocks:
            x = block(x, mask)
        return clip(self.head(x), mask).transpose(1, 2)


def build_refiner(config: RefinerConfig) -> RootRefiner:
    """A refiner, randomly initialised, in training mode."""
    return RootRefiner(config)
