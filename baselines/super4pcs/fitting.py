"""The motions that lay a base on its congruent sets."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def motions_of(
    corners: NDArray[np.float64], target: NDArray[np.float32], sets: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Return the motions that lay a base on sets, (S, 3, 4) float64: rotation, then translation.

    The sum and the difference of the segments' directions become each other's images, so that an angle that differs a
    little is shared by both segments; and so do the means of the four points. Near the motion of least squares, in a
    hundredth of its time.

    Args:
        corners: (4, 3) float64, of the base; the segments are 0-1 and 2-3.
        target: (M, 3) float32.
        sets: (S, 4) int32, indices of target points; no segment of length 0, no parallel ones.
    """
    motions = np.empty((len(sets), 3, 4))
    source_axes, target_axes, images = np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3))
    _write_axes(corners, source_axes)
    for index in range(len(sets)):
        for corner in range(4):
            for axis in range(3):
                images[corner, axis] = target[sets[index, corner], axis]
        _write_axes(images, target_axes)
        motion = motions[index]
        for row in range(3):
            shift = 0.0
            for column in range(3):
                motion[row, column] = 0.0
                for axis in range(3):
                    motion[row, column] += target_axes[axis, row] * source_axes[axis, column]
            for corner in range(4):
                shift += images[corner, row]
                for column in range(3):
                    shift -= motion[row, column] * corners[corner, column]
            motion[row, 3] = shift / 4
    return motions


@njit(cache=True)
def _write_axes(corners: NDArray[np.float64], axes: NDArray[np.float64]) -> None:
    """Write three orthonormal rows: along the sum and the difference of the segments' directions, and their product."""
    first_square, second_square = 0.0, 0.0
    for axis in range(3):
        first_square += (corners[1, axis] - corners[0, axis]) ** 2
        second_square += (corners[3, axis] - corners[2, axis]) ** 2
    first_length, second_length = np.sqrt(first_square), np.sqrt(second_square)
    sum_square, difference_square = 0.0, 0.0
    for axis in range(3):
        u = (corners[1, axis] - corners[0, axis]) / first_length
        v = (corners[3, axis] - corners[2, axis]) / second_length
        axes[0, axis], axes[1, axis] = u + v, u - v
        sum_square += (u + v) ** 2
        difference_square += (u - v) ** 2
    sum_length, difference_length = np.sqrt(sum_square), np.sqrt(difference_square)
    for axis in range(3):
        axes[0, axis] /= sum_length
        axes[1, axis] /= difference_length
    axes[2, 0] = axes[0, 1] * axes[1, 2] - axes[0, 2] * axes[1, 1]
    axes[2, 1] = axes[0, 2] * axes[1, 0] - axes[0, 0] * axes[1, 2]
    axes[2, 2] = axes[0, 0] * axes[1, 1] - axes[0, 1] * axes[1, 0]
