"""A few steps of ICP by a distance grid: enough to tell a good motion from a poor one."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.distance_grid import DistanceGrid, voxel_of
from regbench.geometry.horn import rotation_of_covariance


def polished(
    motions: NDArray[np.float64], source: NDArray[np.float32], grid: DistanceGrid, reaches: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return motions after as many steps of ICP as there are reaches, (S, 3, 4) float64.

    Args:
        motions: (S, 3, 4) float64.
        source: (N, 3) float32.
        grid: Of the target.
        reaches: (K,) float64, the farthest match of each step, in the points' unit.
    """
    return _polished(motions, source, reaches, grid.points, grid.labels, grid.low, grid.cell, grid.shape)


@njit(cache=True)
def _polished(
    motions: NDArray[np.float64],
    source: NDArray[np.float32],
    reaches: NDArray[np.float64],
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    low: NDArray[np.float32],
    cell: float,
    shape: NDArray[np.int64],
) -> NDArray[np.float64]:
    answers = motions.copy()
    per_cell = 1.0 / cell
    sums, covariance, rotation = np.empty((2, 3)), np.empty((3, 3)), np.empty((3, 3))
    for index in range(len(answers)):
        motion = answers[index]
        for step in range(len(reaches)):
            farthest, matched = reaches[step] ** 2, 0
            sums[:] = 0.0
            covariance[:] = 0.0
            for point in range(len(source)):
                a, b, c = source[point, 0], source[point, 1], source[point, 2]
                x = motion[0, 0] * a + motion[0, 1] * b + motion[0, 2] * c + motion[0, 3]
                y = motion[1, 0] * a + motion[1, 1] * b + motion[1, 2] * c + motion[1, 3]
                z = motion[2, 0] * a + motion[2, 1] * b + motion[2, 2] * c + motion[2, 3]
                label = labels[voxel_of(x, y, z, low, per_cell, shape)]
                u, v, w = points[label, 0], points[label, 1], points[label, 2]
                if (u - x) ** 2 + (v - y) ** 2 + (w - z) ** 2 > farthest:
                    continue
                matched += 1
                sums[0, 0] += a
                sums[0, 1] += b
                sums[0, 2] += c
                sums[1, 0] += u
                sums[1, 1] += v
                sums[1, 2] += w
                covariance[0, 0] += a * u
                covariance[0, 1] += a * v
                covariance[0, 2] += a * w
                covariance[1, 0] += b * u
                covariance[1, 1] += b * v
                covariance[1, 2] += b * w
                covariance[2, 0] += c * u
                covariance[2, 1] += c * v
                covariance[2, 2] += c * w
            if matched < 3:
                break
            for row in range(3):
                for column in range(3):
                    covariance[row, column] -= sums[0, row] * sums[1, column] / matched
            rotation_of_covariance(covariance, rotation)
            for row in range(3):
                motion[row, 3] = sums[1, row] / matched
                for column in range(3):
                    motion[row, column] = rotation[row, column]
                    motion[row, 3] -= rotation[row, column] * sums[0, column] / matched
    return answers
