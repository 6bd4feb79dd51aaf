"""ICP with matches read off a distance grid, compiled: near the answer of ICP in a tenth of its time."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.distance_grid import voxel_of
from regbench.geometry.horn import rotation_of_covariance


@njit(cache=True)
def grid_icp(
    source: NDArray[np.float32],
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    low: NDArray[np.float32],
    cell: float,
    shape: NDArray[np.int64],
    rotation: NDArray[np.float64],
    translation: NDArray[np.float64],
    kept: int,
    max_iterations: int,
    tolerance: float,
) -> float:
    """Change a motion in place until the residual no longer falls; return the mean squared distance seen last.

    A match is the point that the grid has for the voxel, which is near but not always the nearest.

    Args:
        source: (N, 3) float32.
        points: Of the grid of the target.
        labels: Likewise.
        low: Likewise.
        cell: Likewise.
        shape: Likewise.
        rotation: (3, 3) float64, changed.
        translation: (3,) float64, changed.
        kept: Points that count, those with the nearest matches (trimmed ICP, Chetverikov et al. 2002).
        max_iterations: Most motions computed.
        tolerance: Stop where the mean square falls by less than this share of itself.
    """
    count = len(source)
    per_cell = 1.0 / cell
    squares, matches = np.empty(count), np.empty(count, np.int32)
    covariance = np.empty((3, 3))
    before, mean = np.inf, np.inf
    for _ in range(max_iterations):
        for index in range(count):
            a, b, c = source[index, 0], source[index, 1], source[index, 2]
            x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c + translation[0]
            y = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c + translation[1]
            z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c + translation[2]
            match = labels[voxel_of(x, y, z, low, per_cell, shape)]
            matches[index] = match
            squares[index] = (points[match, 0] - x) ** 2 + (points[match, 1] - y) ** 2 + (points[match, 2] - z) ** 2
        farthest = np.partition(squares, kept - 1)[kept - 1] if kept < count else np.inf
        total, used = 0.0, 0
        ax = ay = az = bx = by = bz = 0.0
        covariance[:] = 0.0
        for index in range(count):
            if squares[index] > farthest:
                continue
            match = matches[index]
            a, b, c = source[index, 0], source[index, 1], source[index, 2]
            u, v, w = points[match, 0], points[match, 1], points[match, 2]
            total += squares[index]
            used += 1
            ax += a
            ay += b
            az += c
            bx += u
            by += v
            bz += w
            covariance[0, 0] += a * u
            covariance[0, 1] += a * v
            covariance[0, 2] += a * w
            covariance[1, 0] += b * u
            covariance[1, 1] += b * v
            covariance[1, 2] += b * w
            covariance[2, 0] += c * u
            covariance[2, 1] += c * v
            covariance[2, 2] += c * w
        mean = total / used
        if mean >= before * (1 - tolerance):
            return mean
        before = mean
        ax /= used
        ay /= used
        az /= used
        bx /= used
        by /= used
        bz /= used
        covariance[0, 0] -= used * ax * bx
        covariance[0, 1] -= used * ax * by
        covariance[0, 2] -= used * ax * bz
        covariance[1, 0] -= used * ay * bx
        covariance[1, 1] -= used * ay * by
        covariance[1, 2] -= used * ay * bz
        covariance[2, 0] -= used * az * bx
        covariance[2, 1] -= used * az * by
        covariance[2, 2] -= used * az * bz
        rotation_of_covariance(covariance, rotation)
        translation[0] = bx - (rotation[0, 0] * ax + rotation[0, 1] * ay + rotation[0, 2] * az)
        translation[1] = by - (rotation[1, 0] * ax + rotation[1, 1] * ay + rotation[1, 2] * az)
        translation[2] = bz - (rotation[2, 0] * ax + rotation[2, 1] * ay + rotation[2, 2] * az)
    return mean
