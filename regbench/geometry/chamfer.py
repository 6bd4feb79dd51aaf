"""The Chamfer distance of two clouds, for methods that judge their own answers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.nearest_tree import build_tree, nearest_neighbours


def chamfer_distance(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Return mean over x of min over y |x - y| plus mean over y of min over x |x - y|, not squared.

    Args:
        first: (N, 3), N >= 1.
        second: (M, 3), M >= 1.
    """
    _, forth = nearest_neighbours(*build_tree(second), first)
    _, back = nearest_neighbours(*build_tree(first), second)
    return float(np.mean(np.sqrt(forth)) + np.mean(np.sqrt(back)))
