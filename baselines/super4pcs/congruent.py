"""The congruent sets of a base: four points of the target with its lengths, ratios, gap and angle."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .bases import Base

# Most cells along the longest side of the grid of crossings.
CELLS = 64
# Segments at a smaller angle fix no motion.
LARGEST_COSINE = 0.99


def congruent_sets(
    points: NDArray[np.float32],
    first: NDArray[np.int32],
    second: NDArray[np.int32],
    base: Base,
    delta: float,
    *,
    most: int,
    most_tests: int,
) -> tuple[NDArray[np.int32], int]:
    """Return the sets of four points that are congruent to a base (Super 4PCS, sections 3.2 and 3.3).

    A pair of each of two lists makes a set where the pairs' points at the base's ratios are as far apart as the base's
    gap, to `delta`, and their angle is the base's, to the angle that `delta` at their ends makes. Crossings of the
    first list lie in a grid, sorted by cell; the angle is tested among those within reach.

    Args:
        points: (M, 3) float32, the target.
        first: (K, 2) int32, pairs about as long as the base's first segment, i != j.
        second: (L, 2) int32, likewise of the second.
        base: What to be congruent to.
        delta: Largest difference, in the points' unit.
        most: Most sets; the search ends with the last.
        most_tests: Most crossings compared; likewise.

    Returns:
        The sets, (S, 4) int32, in the order of the base's corners; and how many crossings were compared.
    """
    margin = delta / base.lengths[0] + delta / base.lengths[1]
    sets, found, tests = _congruent_sets(
        points,
        first,
        second,
        np.float32(base.ratios[0]),
        np.float32(base.ratios[1]),
        np.float32(max(base.cosine - margin, -LARGEST_COSINE)),
        np.float32(min(base.cosine + margin, LARGEST_COSINE)),
        np.float32(max(base.gap - delta, 0.0)),
        np.float32(base.gap + delta),
        most,
        most_tests,
    )
    return sets[:found], tests


@njit(cache=True)
def _congruent_sets(
    points: NDArray[np.float32],
    first: NDArray[np.int32],
    second: NDArray[np.int32],
    first_ratio: np.float32,
    second_ratio: np.float32,
    least_cosine: np.float32,
    largest_cosine: np.float32,
    least_gap: np.float32,
    largest_gap: np.float32,
    most: int,
    most_tests: int,
) -> tuple[NDArray[np.int32], int, int]:
    """Return the sets, (most, 4), how many there are, and the number of crossings compared."""
    sets, found, tests = np.empty((most, 4), np.int32), 0, 0
    if len(first) == 0 or len(second) == 0:
        return sets, found, tests
    places, directions = _crossings(points, first, first_ratio)
    order, starts, low, cell, shape = _sorted_by_cell(places, largest_gap)
    places, directions = places[order], directions[order]
    queries, query_directions = _crossings(points, second, second_ratio)
    per_cell = np.float32(1.0) / cell
    least_square, largest_square = least_gap * least_gap, largest_gap * largest_gap
    for index in range(len(queries)):
        x, y, z = queries[index]
        u, v, w = query_directions[index]
        i = int(np.floor((x - low[0]) * per_cell))
        j = int(np.floor((y - low[1]) * per_cell))
        k = int(np.floor((z - low[2]) * per_cell))
        bottom, top = max(k - 1, 0), min(k + 1, shape[2] - 1)
        if bottom > top:
            continue
        for near_i in range(max(i - 1, 0), min(i + 2, shape[0])):
            for near_j in range(max(j - 1, 0), min(j + 2, shape[1])):
                # The cells of a column lie beside each other: one run of crossings.
                column = (near_i * shape[1] + near_j) * shape[2]
                begin, end = starts[column + bottom], starts[column + top + 1]
                tests += end - begin
                for other in range(begin, end):
                    dx, dy, dz = places[other, 0] - x, places[other, 1] - y, places[other, 2] - z
                    square = dx * dx + dy * dy + dz * dz
                    if square > largest_square or square < least_square:
                        continue
                    cosine = directions[other, 0] * u + directions[other, 1] * v + directions[other, 2] * w
                    if cosine < least_cosine or cosine > largest_cosine:
                        continue
                    sets[found, 0], sets[found, 1] = _ends(first, order[other])
                    sets[found, 2], sets[found, 3] = _ends(second, index)
                    found += 1
                    if found == most:
                        return sets, found, tests
        if tests > most_tests:
            break
    return sets, found, tests


@njit(cache=True)
def _crossings(
    points: NDArray[np.float32], pairs: NDArray[np.int32], ratio: np.float32
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the points at a ratio of pairs, and the pairs' directions, (2 K, 3) each: both ways along each pair."""
    places, directions = np.empty((2 * len(pairs), 3), np.float32), np.empty((2 * len(pairs), 3), np.float32)
    for index in range(len(places)):
        a, b = _ends(pairs, index)
        square = np.float32(0.0)
        for axis in range(3):
            step = points[b, axis] - points[a, axis]
            places[index, axis] = points[a, axis] + ratio * step
            directions[index, axis] = step
            square += step * step
        length = np.sqrt(square)
        for axis in range(3):
            directions[index, axis] /= length
    return places, directions


@njit(cache=True, inline="always")
def _ends(pairs: NDArray[np.int32], index: int) -> tuple[int, int]:
    """Return the ends of a pair: each stands for both of its directions."""
    if index & 1:
        return pairs[index >> 1, 1], pairs[index >> 1, 0]
    return pairs[index >> 1, 0], pairs[index >> 1, 1]


@njit(cache=True)
def _sorted_by_cell(
    places: NDArray[np.float32], reach: np.float32
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32], np.float32, NDArray[np.int64]]:
    """Return the places' order by cell, where each cell's begin, the grid's corner, a cell's edge, and its shape.

    An edge is no shorter than the reach: what is within it lies in the cells about.
    """
    low, largest = places[0].copy(), places[0].copy()
    for index in range(len(places)):
        for axis in range(3):
            low[axis] = min(low[axis], places[index, axis])
            largest[axis] = max(largest[axis], places[index, axis])
    sides = largest - low
    # Rounding must not put a place into a cell beyond the next.
    cell = np.float32(max(reach * np.float32(1.0001), sides.max() / np.float32(CELLS), np.float32(1e-30)))
    shape = (sides / cell).astype(np.int64) + 1
    starts = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int32)
    cells = np.empty(len(places), np.int32)
    per_cell = np.float32(1.0) / cell
    for index in range(len(places)):
        # Not beyond the last by rounding.
        i = min(int((places[index, 0] - low[0]) * per_cell), shape[0] - 1)
        j = min(int((places[index, 1] - low[1]) * per_cell), shape[1] - 1)
        k = min(int((places[index, 2] - low[2]) * per_cell), shape[2] - 1)
        cells[index] = (i * shape[1] + j) * shape[2] + k
        starts[cells[index] + 1] += 1
    for index in range(1, len(starts)):
        starts[index] += starts[index - 1]
    order, filled = np.empty(len(places), np.int32), starts[:-1].copy()
    for index in range(len(places)):
        order[filled[cells[index]]] = index
        filled[cells[index]] += 1
    return order, starts, low, cell, shape
