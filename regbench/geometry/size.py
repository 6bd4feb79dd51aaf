"""The two lengths that method parameters are relative to: a cloud's extent and its mean point spacing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def extent(points: NDArray[np.float64]) -> float:
    """Return the greatest distance of a point from the centroid, for (N, 3) points.

    It does not change when the cloud is moved, and is 1 for a cloud scaled to the unit sphere: the parameters that
    papers state on ModelNet40 carry over unchanged.

    Raises:
        ValueError: There is no point.
    """
    if len(points) == 0:
        raise ValueError("the extent of a cloud without points is not defined")
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).max()))


def spacing(points: NDArray[np.float64]) -> float:
    """Return the mean distance from a point to its nearest other point, for (N, 3) points.

    Raises:
        ValueError: There are fewer than two points.
    """
    if len(points) < 2:
        raise ValueError(f"the spacing of {len(points)} points is not defined; at least 2 are needed")
    distances, _ = cKDTree(points).query(points, k=2)
    return float(np.asarray(distances)[:, 1].mean())
