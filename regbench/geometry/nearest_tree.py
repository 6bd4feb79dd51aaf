"""Exact nearest neighbours in a k-d tree, compiled: for loops that ask again about points that moved a little."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Ranges of the tree that are searched point by point.
LEAF = 16
# A range of at most 2^62 points halves this often.
DEEPEST = 64


@njit(cache=True)
def build_tree(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int8]]:
    """Sort points into a balanced k-d tree (Bentley 1975).

    The range [low, high) of the sorted points has its root in the middle, the points that are not beyond it along the
    root's axis before it, the others behind it. An axis is the one along which the range is widest.

    Args:
        points: (N, 3), N >= 1, finite.

    Returns:
        The points in the tree's order, (N, 3); their indices, (N,); the axis of every root, (N,).
    """
    count = len(points)
    tree, order = points.copy(), np.arange(count)
    axes = np.zeros(count, np.int8)
    lows, highs = np.empty(DEEPEST, np.int64), np.empty(DEEPEST, np.int64)
    lows[0], highs[0], depth = 0, count, 1
    while depth:
        depth -= 1
        low, high = lows[depth], highs[depth]
        if high - low <= LEAF:
            continue
        axis = _widest(tree, low, high)
        middle = (low + high) // 2
        _select(tree, order, low, high - 1, middle, axis)
        axes[middle] = axis
        lows[depth], highs[depth] = low, middle
        lows[depth + 1], highs[depth + 1] = middle + 1, high
        depth += 2
    return tree, order, axes


@njit(cache=True)
def _widest(tree: NDArray[np.float64], low: int, high: int) -> int:
    """Return the axis along which the points of a range are spread most."""
    answer, most = 0, -1.0
    for axis in range(3):
        least, largest = tree[low, axis], tree[low, axis]
        for index in range(low + 1, high):
            least = min(least, tree[index, axis])
            largest = max(largest, tree[index, axis])
        if largest - least > most:
            answer, most = axis, largest - least
    return answer


@njit(cache=True)
def _select(tree: NDArray[np.float64], order: NDArray[np.int64], first: int, last: int, rank: int, axis: int) -> None:
    """Put the point of a rank along an axis in its place, smaller ones before it and larger ones behind (Hoare)."""
    while first < last:
        pivot = tree[(first + last) // 2, axis]
        left, right = first, last
        while left <= right:
            while tree[left, axis] < pivot:
                left += 1
            while tree[right, axis] > pivot:
                right -= 1
            if left <= right:
                for column in range(3):
                    tree[left, column], tree[right, column] = tree[right, column], tree[left, column]
                order[left], order[right] = order[right], order[left]
                left += 1
                right -= 1
        if rank <= right:
            last = right
        elif rank >= left:
            first = left
        else:
            return


@njit(cache=True)
def nearest_in_tree(
    tree: NDArray[np.float64],
    axes: NDArray[np.int8],
    x: float,
    y: float,
    z: float,
    guess: int,
    lows: NDArray[np.int64],
    highs: NDArray[np.int64],
    beyond: NDArray[np.float64],
) -> tuple[int, float]:
    """Return the place in the tree of the nearest point and its squared distance.

    Args:
        tree: From `build_tree`.
        axes: Likewise.
        x: Of the query.
        y: Of the query.
        z: Of the query.
        guess: A place in the tree: the nearer, the faster; the answer does not depend on it but among equals.
        lows: (DEEPEST,) scratch.
        highs: (DEEPEST,) scratch.
        beyond: (DEEPEST,) scratch.
    """
    best = guess
    least = (tree[guess, 0] - x) ** 2 + (tree[guess, 1] - y) ** 2 + (tree[guess, 2] - z) ** 2
    lows[0], highs[0], beyond[0], depth = 0, len(tree), 0.0, 1
    while depth:
        depth -= 1
        low, high = lows[depth], highs[depth]
        if beyond[depth] >= least:
            continue
        # Down to the leaf on the query's side; what lies on the other sides waits.
        while high - low > LEAF:
            middle = (low + high) // 2
            axis = axes[middle]
            offset = (x if axis == 0 else y if axis == 1 else z) - tree[middle, axis]
            square = (tree[middle, 0] - x) ** 2 + (tree[middle, 1] - y) ** 2 + (tree[middle, 2] - z) ** 2
            if square < least:
                best, least = middle, square
            if offset * offset < least:
                if offset < 0:
                    lows[depth], highs[depth] = middle + 1, high
                else:
                    lows[depth], highs[depth] = low, middle
                beyond[depth] = offset * offset
                depth += 1
            if offset < 0:
                high = middle
            else:
                low = middle + 1
        for index in range(low, high):
            square = (tree[index, 0] - x) ** 2 + (tree[index, 1] - y) ** 2 + (tree[index, 2] - z) ** 2
            if square < least:
                best, least = index, square
    return best, least


@njit(cache=True)
def nearest_neighbours(
    tree: NDArray[np.float64], order: NDArray[np.int64], axes: NDArray[np.int8], queries: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the indices of the nearest points, (Q,), and their squared distances, (Q,).

    Args:
        tree: From `build_tree`.
        order: Likewise.
        axes: Likewise.
        queries: (Q, 3).
    """
    found, squares = np.empty(len(queries), np.int64), np.empty(len(queries))
    lows, highs, beyond = np.empty(DEEPEST, np.int64), np.empty(DEEPEST, np.int64), np.empty(DEEPEST)
    place = 0
    for index in range(len(queries)):
        x, y, z = queries[index]
        place, squares[index] = nearest_in_tree(tree, axes, x, y, z, place, lows, highs, beyond)
        found[index] = order[place]
    return found, squares
