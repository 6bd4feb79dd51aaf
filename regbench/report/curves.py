"""Curves of errors and times, thinned to what a picture can show, and the front of accuracy against time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# What a box shows of a distribution: ends, whiskers, box, median.
BOX_SHARES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)


def ecdf(values: ArrayLike, max_points: int) -> tuple[Array, Array]:
    """Return points of the empirical distribution function of (n,) values: every one, or so many evenly ranked.

    Returns:
        (k,) values, not falling, and (k,) the share of all values that are at most as great; each point is exact.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if not len(ordered):
        return np.empty(0), np.empty(0)
    ranks = np.unique(np.rint(np.linspace(0, len(ordered) - 1, min(max_points, len(ordered)))).astype(np.intp))
    kept = ordered[ranks]
    return kept, np.searchsorted(ordered, kept, side="right") / len(ordered)


def shares_within(values: ArrayLike, thresholds: ArrayLike) -> Array:
    """Return the share of (n,) values that are at most each of (k,) thresholds; NaN where there is no value."""
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    limits = np.asarray(thresholds, dtype=np.float64)
    if not len(ordered):
        return np.full(limits.shape, np.nan)
    shares: Array = np.searchsorted(ordered, limits, side="right") / len(ordered)
    return shares


def pareto_front(costs: Sequence[float], gains: Sequence[float]) -> list[bool]:
    """Return which of n points no other beats: none costs at most as much and gains at least as much, one of it better.

    Args:
        costs: Less is better.
        gains: More is better; give an error with its sign changed.
    """
    points = list(zip(costs, gains, strict=True))

    def is_beaten(cost: float, gain: float) -> bool:
        return any(c <= cost and g >= gain and (c < cost or g > gain) for c, g in points)

    return [not is_beaten(*point) for point in points]
