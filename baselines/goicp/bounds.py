"""What a moved cloud's squared error is at least, by the distance grid, compiled.

All lengths are in voxels of the target's grid, whose low corner is the origin.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.nearest_tree import DEEPEST, nearest_in_tree

from .space import Space

# What single precision may add to a distance, in voxels (coordinates are a few hundred at most), and the share that it
# may add to a sum.
ROUNDING, MARGIN = 1e-4, 1 - 1e-5
# Points between two looks at whether the sum is large enough to stop.
BLOCK = 64


@njit(cache=True, fastmath=True)
def rotate(points: NDArray[np.float32], rotation: NDArray[np.float32], rotated: NDArray[np.float32]) -> None:
    """Write rotated points.

    Args:
        points: (3, N) float32: a row per axis, so that the processor does several points at a time.
        rotation: (3, 3) float32.
        rotated: (3, N) float32, written.
    """
    for row in range(3):
        a, b, c = rotation[row, 0], rotation[row, 1], rotation[row, 2]
        for index in range(points.shape[1]):
            rotated[row, index] = a * points[0, index] + b * points[1, index] + c * points[2, index]


@njit(cache=True, fastmath=True)
def squared_error_bound(
    rotated: NDArray[np.float32],
    reach: NDArray[np.float32],
    chord: float,
    translation: NDArray[np.float32],
    gap: float,
    distances: NDArray[np.float32],
    shape: NDArray[np.int64],
    kept: int,
    limit: float,
    squares: NDArray[np.float32],
) -> float:
    """Return a lower bound on the sum of squared distances over all motions of a cell (Go-ICP, Eqs. 15 and 16).

    A point moves by at most `chord` times its distance from the origin under the rotations of the cell, and by at most
    `gap` under its translations. The nearest point of the target is at least as far from a place as from its voxel's
    centre, less the way from there; outside the grid, the way to the grid adds as in a right triangle, since the grid
    is a box that holds the target.

    Args:
        rotated: (3, N) float32, by the cell's central rotation.
        reach: (N,) float32, distance of each point from the origin.
        chord: 2 sin(half the cell's angle); 0 for one rotation.
        translation: (3,) float32, central.
        gap: Farthest other translation; 0 for one.
        distances: (V,) float32 of an exact grid.
        shape: (3,) of the grid.
        kept: Points that count, those with the least errors; N for all.
        limit: Answer this as soon as the sum is known to reach it.
        squares: (N,) float32 scratch.
    """
    count = rotated.shape[1]
    total = 0.0
    if kept == count:
        for first in range(0, count, BLOCK):
            last = min(first + BLOCK, count)
            total += _sum_of_bounds(rotated, reach, chord, translation, gap, distances, shape, first, last)
            if total * MARGIN >= limit:
                return limit
    else:
        for index in range(count):
            squares[index] = _sum_of_bounds(rotated, reach, chord, translation, gap, distances, shape, index, index + 1)
        total = sum_of_least(squares, kept)
    return min(total * MARGIN, limit)


@njit(cache=True, fastmath=True, inline="always")
def _sum_of_bounds(
    rotated: NDArray[np.float32],
    reach: NDArray[np.float32],
    chord: float,
    translation: NDArray[np.float32],
    gap: float,
    distances: NDArray[np.float32],
    shape: NDArray[np.int64],
    first: int,
    last: int,
) -> float:
    """Return the bound of `squared_error_bound` for the points in [first, last); written without branches, for SIMD."""
    zero, half = np.float32(0.0), np.float32(0.5)
    slack, turn = np.float32(gap + ROUNDING), np.float32(chord)
    tx, ty, tz = translation[0], translation[1], translation[2]
    # The largest coordinates that still truncate to the last voxel.
    hx, hy, hz = np.float32(shape[0] - 1e-3), np.float32(shape[1] - 1e-3), np.float32(shape[2] - 1e-3)
    rows, columns = np.int32(shape[1]), np.int32(shape[2])
    total = zero
    for index in range(first, last):
        x, y, z = rotated[0, index] + tx, rotated[1, index] + ty, rotated[2, index] + tz
        u, v, w = min(max(x, zero), hx), min(max(y, zero), hy), min(max(z, zero), hz)
        i, j, k = np.int32(u), np.int32(v), np.int32(w)
        a, b, c = u - np.float32(i) - half, v - np.float32(j) - half, w - np.float32(k) - half
        inside = distances[np.uint32((i * rows + j) * columns + k)] - np.sqrt(a * a + b * b + c * c)
        inside = max(inside, zero)
        e, f, g = x - u, y - v, z - w
        distance = np.sqrt(inside * inside + e * e + f * f + g * g)
        distance = max(distance - slack - turn * reach[index], zero)
        total += distance * distance
    return float(total)


@njit(cache=True)
def exact_squared_error_bound(
    rotated: NDArray[np.float32],
    reach: NDArray[np.float32],
    chord: float,
    translation: NDArray[np.float32],
    gap: float,
    space: Space,
    squares: NDArray[np.float32],
) -> float:
    """Return what `squared_error_bound` does, by exact nearest neighbours: tighter, and some twenty times slower.

    Args:
        rotated: As for `squared_error_bound`.
        reach: Likewise.
        chord: Likewise.
        translation: Likewise.
        gap: Likewise.
        space: What is searched.
        squares: (N,) float32 scratch.
    """
    lows, highs, beyond = np.empty(DEEPEST, np.int64), np.empty(DEEPEST, np.int64), np.empty(DEEPEST)
    for index in range(rotated.shape[1]):
        x = float(rotated[0, index] + translation[0])
        y = float(rotated[1, index] + translation[1])
        z = float(rotated[2, index] + translation[2])
        i = min(max(int(x), 0), space.shape[0] - 1)
        j = min(max(int(y), 0), space.shape[1] - 1)
        k = min(max(int(z), 0), space.shape[2] - 1)
        guess = space.places[space.labels[(i * space.shape[1] + j) * space.shape[2] + k]]
        square = nearest_in_tree(space.tree, space.axes, x, y, z, guess, lows, highs, beyond)[1]
        squares[index] = max(np.sqrt(square) - gap - ROUNDING - chord * reach[index], 0.0) ** 2
    return sum_of_least(squares, space.kept) * MARGIN


@njit(cache=True, fastmath=True)
def squared_error(
    rotated: NDArray[np.float32],
    translation: NDArray[np.float32],
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    shape: NDArray[np.int64],
    kept: int,
    squares: NDArray[np.float32],
) -> float:
    """Return the sum of squared distances to the points that the grid has for the voxels: never under the true one.

    Args:
        rotated: (3, N) float32.
        translation: (3,) float32.
        points: (M, 3) float32, the target.
        labels: (V,) int32 of its grid.
        shape: (3,) of the grid.
        kept: Points that count, those with the least errors; N for all.
        squares: (N,) float32 scratch.
    """
    count = rotated.shape[1]
    zero = np.float32(0.0)
    tx, ty, tz = translation[0], translation[1], translation[2]
    hx, hy, hz = np.float32(shape[0] - 1e-3), np.float32(shape[1] - 1e-3), np.float32(shape[2] - 1e-3)
    rows, columns = np.int32(shape[1]), np.int32(shape[2])
    for index in range(count):
        x, y, z = rotated[0, index] + tx, rotated[1, index] + ty, rotated[2, index] + tz
        i, j, k = np.int32(min(max(x, zero), hx)), np.int32(min(max(y, zero), hy)), np.int32(min(max(z, zero), hz))
        label = labels[np.uint32((i * rows + j) * columns + k)]
        a, b, c = points[label, 0] - x, points[label, 1] - y, points[label, 2] - z
        squares[index] = a * a + b * b + c * c
    return sum_of_least(squares, kept)


@njit(cache=True, fastmath=True)
def sum_of_least(values: NDArray[np.float32], kept: int) -> float:
    """Return the sum of the least values, `kept` of them."""
    least = values if kept == len(values) else np.partition(values, kept - 1)
    total = 0.0
    for first in range(0, kept, BLOCK):
        block = np.float32(0.0)
        for index in range(first, min(first + BLOCK, kept)):
            block += least[index]
        total += float(block)
    return total
