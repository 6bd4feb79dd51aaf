"""The inner search of Go-ICP: the best translation for a cell of rotations, by branch and bound."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .bounds import exact_squared_error_bound, squared_error_bound
from .heap import TIE, pop, push
from .space import Heap, Space

# Boxes split for one cell of rotations, at most.
MOST_SPLITS = 2000
# Where points move by less than this many voxels in a cell, what the grid leaves open (half a voxel's edge a point) is
# most of what its bound falls short by: exact neighbours are looked up instead.
LOOKED_UP_BELOW = 2.0


@njit(cache=True)
def least_over_translations(
    space: Space,
    rotated: NDArray[np.float32],
    reach: NDArray[np.float32],
    chord: float,
    finest: float,
    limit: float,
    squares: NDArray[np.float32],
    heap: Heap,
    translation: NDArray[np.float32],
) -> float:
    """Return a lower bound on the squared error over a cell of rotations and the range of translations.

    Boxes are split, the least bound first, until the one on top is so small that splitting it further would tell little
    (or so many have been split that it takes too long). Its bound is then a bound for all.

    Args:
        space: What is searched.
        rotated: (3, N) float32 points, by the cell's central rotation.
        reach: (N,) float32, distance of each point from the origin.
        chord: As for `squared_error_bound`.
        finest: A box whose corners are no farther than this from its centre is not split.
        limit: Answer this where the error reaches it everywhere.
        squares: (N,) scratch.
        heap: Scratch.
        translation: (3,) float32, written: the centre of the box on top, where the error is likely least.
    """
    diagonal = sqrt(space.half[0] ** 2 + space.half[1] ** 2 + space.half[2] ** 2)
    turn = chord * reach.mean()
    cell, child = np.empty(4, np.float32), np.empty(4, np.float32)
    child[:3], child[3] = space.centre, 1.0
    bound = squared_error_bound(
        rotated, reach, chord, child[:3], diagonal, space.distances, space.shape, space.kept, limit, squares
    )
    size, splits = 0, 0
    if bound < limit:
        size = push(heap.bounds, heap.cells, size, bound + TIE, child)
    while size > 0:
        bound = pop(heap.bounds, heap.cells, size, cell)
        size -= 1
        # A negative scale marks a box whose neighbours have been looked up.
        scale = abs(cell[3])
        ends = splits == MOST_SPLITS or size + 8 > len(heap.bounds)
        if ends or scale * diagonal <= finest:
            if ends or cell[3] < 0 or turn + scale * diagonal > LOOKED_UP_BELOW:
                translation[:] = cell[:3]
                return max(bound - TIE, 0.0)
            looked_up = exact_squared_error_bound(rotated, reach, chord, cell[:3], scale * diagonal, space, squares)
            cell[3] = -scale
            if looked_up < limit:
                size = push(heap.bounds, heap.cells, size, max(bound, looked_up), cell)
            continue
        splits += 1
        scale = scale * np.float32(0.5)
        child[3] = scale
        for corner in range(8):
            for axis in range(3):
                side = 1.0 if corner >> axis & 1 else -1.0
                child[axis] = cell[axis] + side * scale * space.half[axis]
            bound = squared_error_bound(
                rotated, reach, chord, child[:3], scale * diagonal, space.distances, space.shape, space.kept, limit,
                squares,
            )  # fmt: skip
            if bound < limit:
                # Of equal bounds (many are 0) the smaller box goes first: it may end the search.
                size = push(heap.bounds, heap.cells, size, bound + scale * TIE, child)
    return limit
