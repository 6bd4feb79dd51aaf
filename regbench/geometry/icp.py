"""Point-to-point ICP without open3d, as the last step of other methods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from regbench.geometry.kabsch import kabsch
from regbench.geometry.se3 import transform


@dataclass(frozen=True, eq=False)
class IcpResult:
    """Where ICP ended.

    Attributes:
        T_target_source: (4, 4) float64.
        iterations: Motions computed.
        converged: Whether the matches stopped changing; every further iteration would answer the same.
    """

    T_target_source: NDArray[np.float64]
    iterations: int
    converged: bool


def icp(
    source: NDArray[np.float64],
    target: NDArray[np.float64],
    start: NDArray[np.float64],
    *,
    max_iterations: int = 100,
    max_distance: float = np.inf,
) -> IcpResult:
    """Align two clouds by point-to-point ICP (Besl and McKay 1992).

    Args:
        source: (N, 3), N >= 1.
        target: (M, 3), M >= 1.
        start: (4, 4) first guess of T_target_source.
        max_iterations: Most motions computed.
        max_distance: Pairs farther apart are left out; where fewer than three are left, the motion so far is the
            answer.
    """
    tree = cKDTree(target)
    T, matches = np.array(start, dtype=np.float64), None
    for iteration in range(max_iterations):
        # A point without a match within max_distance gets the index len(target).
        nearest = np.asarray(tree.query(transform(T, source), distance_upper_bound=max_distance)[1])
        if matches is not None and np.array_equal(nearest, matches):
            return IcpResult(T, iteration, True)
        matches = nearest
        matched = matches < len(target)
        if max_distance < np.inf and matched.sum() < 3:
            return IcpResult(T, iteration, False)
        T = kabsch(source[matched], target[matches[matched]])
    return IcpResult(T, max_iterations, False)
