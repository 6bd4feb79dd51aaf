"""The nearest point of every voxel, exactly, compiled: blocks of voxels share the few points that can be nearest."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Edge of the largest blocks, in voxels; each is halved until it is a voxel.
BLOCK = 8
LEVELS = 4


@njit(cache=True)
def exact_distances(
    points: NDArray[np.float32], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return labels and distances of all voxels, (V,) each, in the order of `DistanceGrid`.

    A point can be nearest to a voxel's centre in a block only if it is no farther from the block's centre than the
    nearest one there, plus twice the way to the farthest such voxel's centre (triangle inequality). So each block hands
    on what is left of its own points to its eighths.

    Args:
        points: (3, M) float32, in voxels from the grid's low corner, M >= 1.
        shape: (3,) voxels along x, y, z.
    """
    count = points.shape[1]
    width, height, depth = shape
    labels = np.empty(width * height * depth, np.int32)
    distances = np.empty(width * height * depth, np.float32)
    # What is left on each level: coordinates, indices, number.
    left = np.empty((LEVELS, 3, count + 1), np.float32)
    indices = np.empty((LEVELS, count + 1), np.int32)
    numbers = np.empty(LEVELS, np.int64)
    left[0, :, :count], numbers[0] = points, count
    for index in range(count):
        indices[0, index] = index
    squares = np.empty(count, np.float32)
    blocks = np.empty((8 * LEVELS, 4), np.int64)
    for first_i in range(0, width, BLOCK):
        for first_j in range(0, height, BLOCK):
            for first_k in range(0, depth, BLOCK):
                blocks[0, 0], blocks[0, 1], blocks[0, 2], blocks[0, 3] = first_i, first_j, first_k, 0
                waiting = 1
                while waiting > 0:
                    waiting -= 1
                    i, j, k, level = blocks[waiting]
                    edge = BLOCK >> level
                    number = numbers[level]
                    half = np.float32(0.5 * edge)
                    least = _squares_to(
                        left[level], number, np.float32(i) + half, np.float32(j) + half, np.float32(k) + half, squares
                    )
                    if edge == 1:
                        voxel = (i * height + j) * depth + k
                        distances[voxel] = np.sqrt(least)
                        for place in range(number):
                            if squares[place] == least:
                                labels[voxel] = indices[level, place]
                                break
                        continue
                    # Twice the way from the block's centre to its corner voxels' centres; rounding adds a little.
                    farthest = np.sqrt(least) + np.float32((edge - 1) * np.sqrt(3.0))
                    numbers[level + 1] = _hand_on(
                        left[level],
                        indices[level],
                        number,
                        squares,
                        farthest * farthest * np.float32(1 + 1e-5),
                        left[level + 1],
                        indices[level + 1],
                    )
                    for corner in range(8):
                        a = i + (corner & 1) * (edge // 2)
                        b = j + (corner >> 1 & 1) * (edge // 2)
                        c = k + (corner >> 2 & 1) * (edge // 2)
                        if a < width and b < height and c < depth:
                            blocks[waiting, 0], blocks[waiting, 1], blocks[waiting, 2] = a, b, c
                            blocks[waiting, 3] = level + 1
                            waiting += 1
    return labels, distances


@njit(cache=True, fastmath=True)
def _squares_to(
    points: NDArray[np.float32], number: int, x: np.float32, y: np.float32, z: np.float32, squares: NDArray[np.float32]
) -> np.float32:
    """Write the first points' squared distances to a place, and return the least."""
    least = np.float32(np.inf)
    for index in range(number):
        a, b, c = points[0, index] - x, points[1, index] - y, points[2, index] - z
        square = a * a + b * b + c * c
        squares[index] = square
        least = min(least, square)
    return least


@njit(cache=True)
def _hand_on(
    points: NDArray[np.float32],
    indices: NDArray[np.int32],
    number: int,
    squares: NDArray[np.float32],
    most: np.float32,
    kept: NDArray[np.float32],
    kept_indices: NDArray[np.int32],
) -> int:
    """Copy the points of which the square is at most `most`, and return how many they are."""
    count = 0
    for index in range(number):
        # Written in any case and kept by counting: a branch that is hard to predict would cost more.
        kept[0, count], kept[1, count], kept[2, count] = points[0, index], points[1, index], points[2, index]
        kept_indices[count] = indices[index]
        count += squares[index] <= most
    return count
