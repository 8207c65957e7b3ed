"""What each scale adds: the energy of the latent that is left after 1, 2, ... N scales (systems.md A6)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError


def residual_energy(latent: ArrayLike, per_level: ArrayLike) -> NDArray[np.float64]:
    """Share of ||z||^2 left after 0..N scales, float64 [N+1]; the first is 1.

    latent: z [T, D] before quantization; per_level: [N, T, D] what each scale adds. The shares may rise: nothing in the
    quantizer forces a scale to help. nan throughout if z is 0. PlaygroundError if the shapes do not fit.
    """
    z, levels = np.asarray(latent, np.float64), np.asarray(per_level, np.float64)
    if z.ndim != 2 or levels.ndim != 3 or levels.shape[1:] != z.shape:
        raise PlaygroundError(
            f"the levels of a latent {list(z.shape)} have the shape [N, {', '.join(map(str, z.shape))}], "
            f"got {list(levels.shape)}"
        )
    rest = np.concatenate([z[None], z - np.cumsum(levels, axis=0)])
    energy = np.square(rest).sum(axis=(1, 2))
    return np.full(len(energy), np.nan) if energy[0] == 0 else energy / energy[0]


class ScaleEnergy:
    """Residual energy by scale over many motions.

    After `fit`:
        left_    float64 [N+1], mean share left after 0..N scales
        low_     float64 [N+1], 10th percentile over the motions
        high_    float64 [N+1], 90th percentile
        gain_    float64 [N], mean share that each scale removes (negative where a scale adds error)
        count_   number of motions counted
    """

    left_: NDArray[np.float64]
    low_: NDArray[np.float64]
    high_: NDArray[np.float64]
    gain_: NDArray[np.float64]
    count_: int

    def fit(self, energies: ArrayLike) -> "ScaleEnergy":
        """energies: [M, N+1], one `residual_energy` a motion; rows that are not finite (a latent of 0) are left out.

        PlaygroundError if no row is left.
        """
        rows = np.asarray(energies, np.float64)
        if rows.ndim != 2 or rows.shape[1] < 2:
            raise PlaygroundError(f"energies [motions, scales + 1] are summarised, got {list(rows.shape)}")
        rows = rows[np.isfinite(rows).all(axis=1)]
        if not len(rows):
            raise PlaygroundError("no motion with a residual energy was given; at least one is needed")
        self.left_ = rows.mean(axis=0)
        self.low_, self.high_ = np.percentile(rows, [10, 90], axis=0)
        self.gain_ = -np.diff(self.left_)
        self.count_ = len(rows)
        return self
