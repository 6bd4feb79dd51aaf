"""The outer search of Go-ICP: branch and bound over rotations, in slices, so that Python can look at the clock.

All lengths are in voxels of the target's grid, whose low corner is the origin.
"""

from __future__ import annotations

from math import sin

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .bounds import rotate, squared_error
from .heap import TIE, pop, push
from .rotation_cells import cell_angle, is_outside_ball, is_repeated, rotation_at
from .space import Heap, Space
from .translation_search import least_over_translations

# How a slice ended: every cell left is known to be no better than the limit; a motion better than the incumbent
# was found; the slice is over; the heap is full.
FINISHED, IMPROVED, PAUSED, FULL = 0, 1, 2, 3


@njit(cache=True)
def search_slice(
    space: Space,
    outer: Heap,
    inner: Heap,
    size: int,
    incumbent: float,
    threshold: float,
    search_centres: bool,
    most_nodes: int,
    rotation: NDArray[np.float32],
    translation: NDArray[np.float32],
) -> tuple[int, int, int, float]:
    """Split cells of rotations, the least bound first.

    Args:
        space: What is searched.
        outer: Cells of rotations.
        inner: Scratch of the search over translations.
        size: Cells in the outer heap.
        incumbent: Sum of squared errors of the best motion so far.
        threshold: Cells whose bound is not under the incumbent by more than this are dropped.
        search_centres: Look for the best translation of every cell's central rotation, as the paper does, rather than
            try the one where the cell's bound is least.
        most_nodes: Cells of rotations to look at, before the slice is over.
        rotation: (3, 3) float32, written where a better motion was found.
        translation: (3,) float32, likewise.

    Returns:
        How the slice ended, cells in the heap now, cells looked at, and a bound under every motion that no cell before
        has ruled out (the incumbent less the threshold where none is left).
    """
    count = space.points.shape[1]
    rotated, squares = np.empty((3, count), np.float32), np.empty(count, np.float32)
    still = np.zeros(count, np.float32)
    cell, child, central = np.empty(4, np.float32), np.empty(4, np.float32), np.empty((3, 3), np.float32)
    place = np.empty(3, np.float32)
    mean_reach = space.reach.mean()
    nodes = 0
    while size > 0:
        limit = incumbent - threshold
        if outer.bounds[0] >= limit:
            return FINISHED, size, nodes, limit
        if nodes >= most_nodes:
            return PAUSED, size, nodes, outer.bounds[0]
        if size + 8 > len(outer.bounds):
            return FULL, size, nodes, outer.bounds[0]
        pop(outer.bounds, outer.cells, size, cell)
        size -= 1
        child[3] = cell[3] * np.float32(0.5)
        least = incumbent
        for corner in range(8):
            if is_repeated(corner, space.rotation_half):
                continue
            for axis in range(3):
                side = 1.0 if corner >> axis & 1 else -1.0
                child[axis] = cell[axis] + side * child[3] * space.rotation_half[axis]
            if is_outside_ball(child[0], child[1], child[2], space.rotation_half, child[3], space.euler):
                continue
            nodes += 1
            rotation_at(child[0], child[1], child[2], space.euler, central)
            rotate(space.points, central, rotated)
            chord = 2.0 * sin(cell_angle(space.rotation_half, child[3], space.euler) / 2.0)
            bound = least_over_translations(
                space, rotated, space.reach, chord, 0.5 * chord * mean_reach, limit, squares, inner, place
            )
            if bound >= limit:
                continue
            size = push(outer.bounds, outer.cells, size, bound + child[3] * TIE, child)
            if search_centres:
                under = least_over_translations(space, rotated, still, 0.0, 1.0, least, squares, inner, place)
                if under >= least:
                    continue
            error = squared_error(rotated, place, space.target, space.labels, space.shape, space.kept, squares)
            if error < least:
                least = error
                rotation[:] = central
                translation[:] = place
        if least < incumbent:
            return IMPROVED, size, nodes, outer.bounds[0]
    return FINISHED, size, nodes, incumbent - threshold
