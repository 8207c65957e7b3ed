"""MOGO's affine residual levels and the loss around them (MoSA-VQ, arXiv 2506.05952; systems.md C1)."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

OUTER = 0.02  # what every trainer multiplies a tokenizer's commitment with (TokenizerTraining.commitment)


class Affine(nn.Module):
    """u = W r + b with a positive diagonal W = exp(log_scale) and a bias, both learned, at the start 1 and 0."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.log_scale = nn.Parameter(torch.zeros(width))
        self.bias = nn.Parameter(torch.zeros(width))

    def forward(self, residual: Tensor) -> Tensor:
        """Residual [..., D] -> what is looked up [..., D]."""
        return residual * self.log_scale.exp() + self.bias

    def inverse(self, codes: Tensor) -> Tensor:
        """Codes [..., D] -> what they stand for, W^-1 (q - b) [..., D]."""
        return (codes - self.bias) * (-self.log_scale).exp()

    def distance(self) -> Tensor:
        """||W - I||_F^2 + ||b||^2; scalar."""
        return (self.log_scale.exp() - 1).square().sum() + self.bias.square().sum()


@dataclass(frozen=True)
class Penalties:
    """Weights of C1's loss. The paper prints none of the three; these are the fact sheet's."""

    beta: float = 0.02  # commitment, summed over levels
    gamma: float = 1e-3  # distance of W and b from identity and 0, summed over levels
    decorrelation: float = (
        1e-2  # squared cross-covariance of a level and what it leaves, summed over levels but the last
    )


def cross_covariance(a: Tensor, b: Tensor) -> Tensor:
    """Cross-covariance [D, D] of two sets of n vectors [n, D], means removed, divided by n."""
    return (a - a.mean(dim=0)).T @ (b - b.mean(dim=0)) / len(a)
