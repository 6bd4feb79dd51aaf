"""How well motions lay the source on the target: looked up in a distance grid, for thousands of motions."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.distance_grid import DistanceGrid, voxel_of

# A motion is given up if it is not among so many best by so many points of the source.
ROUNDS = ((16, 2048), (64, 256), (256, 256))


def best_of(
    motions: NDArray[np.float64], source: NDArray[np.float32], grid: DistanceGrid, reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the motions that lay the source best on the target, best first, and their scores.

    Most motions are wrong by far, and a few points show it: they are given up early, in rounds.

    Args:
        motions: (S, 3, 4) float64.
        source: (N, 3) float32, in random order.
        grid: Of the target.
        reach: See `scores_of`.
    """
    for points, kept in ROUNDS:
        scores = scores_of(motions, source[:points], grid, reach)
        best = np.argsort(-scores, kind="stable")[:kept]
        motions, scores = motions[best], scores[best]
    return motions, scores


def scores_of(
    motions: NDArray[np.float64], source: NDArray[np.float32], grid: DistanceGrid, reach: float
) -> NDArray[np.float64]:
    """Return a score in [0, 1] for each motion: 4PCS's largest common point set, each point weighted by its nearness.

    A point at distance d from the target counts 1 - (d / reach)^2, and 0 beyond the reach.

    Args:
        motions: (S, 3, 4) float64.
        source: (N, 3) float32, N >= 1.
        grid: Of the target.
        reach: Largest distance that counts, in the points' unit.
    """
    return _scores(
        motions.astype(np.float32), source, np.float32(reach), grid.points, grid.labels, grid.low, grid.cell, grid.shape
    )


def least_distances(grid: DistanceGrid, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far (N, 3) points are from the grid's cloud at least, as far as the grid can tell."""
    places = np.clip(((points - grid.low) / grid.cell).astype(np.int64), 0, grid.shape - 1)
    voxels = (places[:, 0] * grid.shape[1] + places[:, 1]) * grid.shape[2] + places[:, 2]
    # Half a voxel's diagonal from the point to the centre, and as much for a labelled point that is not the nearest.
    distances: NDArray[np.float64] = grid.distances[voxels] - np.sqrt(3.0) * grid.cell
    return distances


@njit(cache=True)
def _scores(
    motions: NDArray[np.float32],
    source: NDArray[np.float32],
    reach: np.float32,
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    low: NDArray[np.float32],
    cell: float,
    shape: NDArray[np.int64],
) -> NDArray[np.float64]:
    scores = np.empty(len(motions))
    per_cell, one = 1.0 / cell, np.float32(1.0)
    per_square = one / (reach * reach)
    for index in range(len(motions)):
        motion, total = motions[index], np.float32(0.0)
        for point in range(len(source)):
            a, b, c = source[point, 0], source[point, 1], source[point, 2]
            x = motion[0, 0] * a + motion[0, 1] * b + motion[0, 2] * c + motion[0, 3]
            y = motion[1, 0] * a + motion[1, 1] * b + motion[1, 2] * c + motion[1, 3]
            z = motion[2, 0] * a + motion[2, 1] * b + motion[2, 2] * c + motion[2, 3]
            label = labels[voxel_of(x, y, z, low, per_cell, shape)]
            dx, dy, dz = points[label, 0] - x, points[label, 1] - y, points[label, 2] - z
            total += max(one - (dx * dx + dy * dy + dz * dz) * per_square, np.float32(0.0))
        scores[index] = total / len(source)
    return scores
