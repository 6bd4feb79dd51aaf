"""A few steps of ICP by a distance grid: enough to tell a good motion from a poor one."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.distance_grid import DistanceGrid, voxel_of
from regbench.geometry.matches import add_match, fit_matches, moved_point


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
    sums, products = np.empty((2, 3)), np.empty((3, 3))
    for index in range(len(answers)):
        # Copies: views with gaps cost a tenth of the time.
        rotation, translation = answers[index, :, :3].copy(), answers[index, :, 3].copy()
        for step in range(len(reaches)):
            farthest, matched = reaches[step] ** 2, 0
            sums[:] = 0.0
            products[:] = 0.0
            for point in range(len(source)):
                x, y, z = moved_point(rotation, translation, source, point)
                label = labels[voxel_of(x, y, z, low, per_cell, shape)]
                u, v, w = points[label, 0], points[label, 1], points[label, 2]
                if (u - x) ** 2 + (v - y) ** 2 + (w - z) ** 2 <= farthest:
                    matched += 1
                    add_match(sums, products, source, point, points, label)
            if matched < 3:
                break
            fit_matches(sums, products, matched, source, points, rotation, translation)
        answers[index, :, :3], answers[index, :, 3] = rotation, translation
    return answers
