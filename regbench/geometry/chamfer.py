"""The Chamfer distance of two clouds, for methods that judge their own answers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def chamfer_distance(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Return mean over x of min over y |x - y| plus mean over y of min over x |x - y|, not squared.

    Args:
        first: (N, 3), N >= 1.
        second: (M, 3), M >= 1.
    """
    forth, _ = cKDTree(second).query(first)
    back, _ = cKDTree(first).query(second)
    return float(np.mean(forth) + np.mean(back))
