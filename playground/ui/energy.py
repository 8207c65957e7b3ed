"""The small bars in the panel of the room Tokenize: energy left after each scale, and the error beside it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from playground.analysis.residual import ScaleEnergy
from playground.figures.residual import residual_bars
from playground.ui.facts import significant

HEIGHT = 104
LABELS = {
    "upto": "% of energy missing, and MPJPE in mm, after scales 1 to n",
    "only": "% of energy missing after scales 1 to n; MPJPE in mm of n alone",
    "without": "% of energy missing after scales 1 to n; MPJPE in mm without n",
}


def energy_bars(energy: ArrayLike, sizes: Sequence[int], errors_mm: ArrayLike, kind: str = "upto") -> str:
    """Plotly JSON text: energy [N + 1] as bars, MPJPE [N] in mm in words under them, without axes to fit the panel.

    kind: "upto", "only" or "without", which scales the errors belong to.
    """
    errors = [f"<b>{significant(float(error))}</b>" for error in np.asarray(errors_mm)]
    figure = residual_bars(ScaleEnergy().fit([np.asarray(energy)]), sizes, height=HEIGHT)
    figure.update_layout(margin={"l": 0, "r": 0, "t": 14, "b": 32}, meta={"kind": kind})
    ticks = ["n<br>mm", *(f"{n}<br>{error}" for n, error in enumerate(errors, start=1))]
    figure.update_xaxes(title="", ticktext=ticks, showline=False)
    figure.update_yaxes(visible=False)
    return str(figure.to_json())
