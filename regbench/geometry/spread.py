"""The order in which a few points of a cloud cover it best, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def spread_order(points: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Return indices of points, each the farthest from those before it (farthest point sampling, Gonzalez 1985).

    Where points are left that repeat earlier ones, they follow in their own order. The cost is N times `count`.

    Args:
        points: (N, 3), N >= 1.
        count: Indices returned, at most N.

    Returns:
        (count,) distinct indices; the first is the point farthest from the origin.
    """
    order = np.empty(count, np.int64)
    squares = np.empty(len(points))
    for index in range(len(points)):
        squares[index] = points[index, 0] ** 2 + points[index, 1] ** 2 + points[index, 2] ** 2
    chosen = int(np.argmax(squares))
    squares[:] = np.inf
    for place in range(count):
        order[place] = chosen
        x, y, z = points[chosen, 0], points[chosen, 1], points[chosen, 2]
        squares[chosen] = -1.0
        farthest, following = -1.0, 0
        for index in range(len(points)):
            if squares[index] < 0:
                continue
            square = (points[index, 0] - x) ** 2 + (points[index, 1] - y) ** 2 + (points[index, 2] - z) ** 2
            squares[index] = min(squares[index], square)
            if squares[index] > farthest:
                farthest, following = squares[index], index
        chosen = following
    return order
