"""What the levels of a quantizer share with each other and with what they leave (MOGO, arXiv 2506.05952; C1).

A level that leaves behind what it could have said itself is correlated with its residual; MOGO's decorrelation loss
pushes that to 0. The coupling below is the size of such a cross-covariance, made free of scale: 0 for uncorrelated
vectors, 1 for vectors that are multiples of one direction each and rise and fall together.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError

Floats = NDArray[np.float64]


def coupling(cross: ArrayLike, first: float, second: float) -> float:
    """||C||_F / sqrt(tr A tr B) of a cross-covariance C [D, E] and the total variances tr A, tr B; 0 to 1.

    nan where one side does not vary.
    """
    if first <= 0 or second <= 0:
        return float("nan")
    return float(np.linalg.norm(np.asarray(cross, np.float64))) / float(np.sqrt(first * second))


class LevelMoments:
    """First and second moments of latents and of what each level adds, gathered batch by batch.

    After `add`:
        count_   vectors seen
    """

    count_: int

    def __init__(self, levels: int, width: int) -> None:
        self.levels = levels
        self.width = width
        self.count_ = 0
        self._sum = np.zeros((levels + 1) * width)
        self._square = np.zeros(((levels + 1) * width,) * 2)

    def add(self, latent: ArrayLike, per_level: ArrayLike) -> "LevelMoments":
        """latent: z [n, D]; per_level: [N, n, D] what each level adds. PlaygroundError for other shapes."""
        z, shares = np.asarray(latent, np.float64), np.asarray(per_level, np.float64)
        if z.ndim != 2 or z.shape[1] != self.width or shares.shape != (self.levels, *z.shape):
            raise PlaygroundError(
                f"moments of {self.levels} levels of width {self.width} take [n, {self.width}] and"
                f" [{self.levels}, n, {self.width}], got {list(z.shape)} and {list(shares.shape)}"
            )
        rows = np.concatenate([z[None], shares]).transpose(1, 0, 2).reshape(len(z), -1)
        self.count_ += len(z)
        self._sum += rows.sum(axis=0)
        self._square += rows.T @ rows
        return self

    def covariance(self) -> Floats:
        """[N+1, D, N+1, D] of the latent (first) and the levels, means removed, divided by the number of vectors.

        PlaygroundError before anything was added.
        """
        if not self.count_:
            raise PlaygroundError("no latent was given; at least one is needed")
        mean = self._sum / self.count_
        whole = self._square / self.count_ - np.outer(mean, mean)
        return whole.reshape(self.levels + 1, self.width, self.levels + 1, self.width)

    def left_coupling(self) -> Floats:
        """Coupling of every level with the residual that it leaves, float64 [N] (lambda's term of C1)."""
        whole = self.covariance()
        found = []
        for level in range(1, self.levels + 1):
            rest = np.zeros(self.levels + 1)  # the residual after this level: z minus the shares so far
            rest[0], rest[1 : level + 1] = 1.0, -1.0
            cross = np.einsum("dje,j->de", whole[level], rest)
            own = float(np.trace(whole[level, :, level]))
            other = float(np.einsum("i,idjd,j->", rest, whole, rest))
            found.append(coupling(cross, *self._real(whole, own, other)))
        return np.array(found)

    def between(self) -> Floats:
        """Coupling of every level with every other one, float64 [N, N]; the diagonal is a level with itself."""
        every = self.covariance()
        whole = every[1:, :, 1:]
        total = self._real(every, *(float(np.trace(whole[n, :, n])) for n in range(self.levels)))
        return np.array(
            [[coupling(whole[i, :, j], total[i], total[j]) for j in range(self.levels)] for i in range(self.levels)]
        )

    @staticmethod
    def _real(whole: Floats, *variances: float) -> list[float]:
        """Variances, those that are rounding beside the largest squares as 0."""
        least = 1e-12 * float(np.einsum("idid->", whole))
        return [value if value > least else 0.0 for value in variances]
