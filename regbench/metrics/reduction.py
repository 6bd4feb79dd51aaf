"""From one value per trial to the one figure of a row."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Reduction = Literal["mean", "root mean", "median", "p75", "p95"]
QUANTILES: dict[str, float] = {"median": 0.5, "p75": 0.75, "p95": 0.95}


def reduce(values: Array, reduction: Reduction) -> float:
    """Return the figure of (n,) values: the mean, its root, or a quantile (linear between ranks); NaN if empty."""
    if not values.size:
        return float("nan")
    if reduction in QUANTILES:
        return float(np.quantile(values, QUANTILES[reduction]))
    mean = float(np.mean(values))
    return mean if reduction == "mean" else float(np.sqrt(mean))
