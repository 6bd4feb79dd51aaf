"""Fewer points that cover the same surface: what a search works on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.spread import spread_order

# A much larger cloud is first drawn from at random, so many points for one that is wanted: for voxels, which are fast,
# and for distances, of which each point that is wanted takes one to every point there is.
PER_VOXEL, PER_SPREAD_POINT = 50, 5
# The voxels' edge is found in so many steps, or where at least this share of the points wanted is left.
STEPS, LEAST_SHARE = 12, 0.9


def distinct_points(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (N, 3) points without repetitions, in an order that does not depend on theirs."""
    return np.unique(points, axis=0)


def drawn(points: NDArray[np.float64], most: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the (N, 3) points, or so many of them drawn at random."""
    return points if len(points) <= most else points[rng.choice(len(points), most, replace=False)]


def spread(points: NDArray[np.float64], most: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the points, or at most so many of them that cover the cloud, the farthest from each other first.

    Args:
        points: (N, 3), N >= 1.
        most: Most points returned.
        rng: Draws from clouds that are much larger.
    """
    chosen = drawn(points, PER_SPREAD_POINT * most, rng)
    return chosen[spread_order(chosen, min(len(chosen), most))]


def thinned(points: NDArray[np.float64], most: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return at most so many points that cover a cloud evenly, however dense it is where: the means of voxels' points.

    Args:
        points: (N, 3).
        most: Most points returned; a cloud with no more than these is returned as it is.
        rng: Draws from clouds that are much larger.
    """
    if len(points) <= most:
        return points
    points = drawn(points, PER_VOXEL * most, rng)
    low = points.min(axis=0)
    edge = float((points.max(axis=0) - low).max()) / np.sqrt(most)
    best = points[:1]
    for _ in range(STEPS):
        means = _means_of_voxels(points, low, edge)
        if len(best) < len(means) <= most:
            best = means
        if LEAST_SHARE * most <= len(means) <= most:
            break
        # A surface meets a number of voxels that goes with the inverse square of their edge. A little under the aim,
        # so that the steps do not end just above it.
        edge *= np.sqrt(len(means) / (0.5 * (1 + LEAST_SHARE) * most))
    return best


def _means_of_voxels(points: NDArray[np.float64], low: NDArray[np.float64], edge: float) -> NDArray[np.float64]:
    """Return one point, the mean, for each voxel that holds any."""
    voxels = ((points - low) / edge).astype(np.int64)
    sides = voxels.max(axis=0) + 1
    keys = (voxels[:, 0] * sides[1] + voxels[:, 1]) * sides[2] + voxels[:, 2]
    _, places, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(places, weights=points[:, axis]) for axis in range(3)], axis=1)
    means: NDArray[np.float64] = sums / counts[:, None]
    return means
