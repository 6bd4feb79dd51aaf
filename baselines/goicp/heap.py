"""A binary heap of search cells, compiled: the one of the least bound is on top."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Added to a key, times the cell's scale (at most 1), so that the smaller of two cells with equal bounds goes first.
TIE = 1e-9


@njit(cache=True)
def push(
    bounds: NDArray[np.float64], cells: NDArray[np.float32], size: int, bound: float, cell: NDArray[np.float32]
) -> int:
    """Add a cell and return the new size; the arrays must have room.

    Args:
        bounds: (C,) float64, the heap's keys.
        cells: (C, 4) float32, the centre and the scale of each.
        size: Cells in the heap.
        bound: Key of the new one.
        cell: Its four numbers.
    """
    place = size
    while place > 0:
        parent = (place - 1) // 2
        if bounds[parent] <= bound:
            break
        bounds[place] = bounds[parent]
        for column in range(4):
            cells[place, column] = cells[parent, column]
        place = parent
    bounds[place] = bound
    for column in range(4):
        cells[place, column] = cell[column]
    return size + 1


@njit(cache=True)
def pop(bounds: NDArray[np.float64], cells: NDArray[np.float32], size: int, cell: NDArray[np.float32]) -> float:
    """Take the top cell out, write it to `cell`, and return its bound; the heap is one smaller then.

    Args:
        bounds: As for `push`.
        cells: Likewise.
        size: Cells in the heap before, at least one.
        cell: (4,) float32, written.
    """
    bound: float = bounds[0]
    for column in range(4):
        cell[column] = cells[0, column]
    size -= 1
    moving = bounds[size]
    place = 0
    while True:
        child = 2 * place + 1
        if child >= size:
            break
        if child + 1 < size and bounds[child + 1] < bounds[child]:
            child += 1
        if moving <= bounds[child]:
            break
        bounds[place] = bounds[child]
        for column in range(4):
            cells[place, column] = cells[child, column]
        place = child
    if size > 0:
        bounds[place] = moving
        for column in range(4):
            cells[place, column] = cells[size, column]
    return bound
