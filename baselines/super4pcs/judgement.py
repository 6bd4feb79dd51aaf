"""What a motion leaves between two clouds, exactly and both ways: the last word between candidates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.nearest_tree import build_tree, nearest_neighbours
from regbench.geometry.se3 import invert, transform


class Judgement:
    """Residuals of motions between two clouds.

    Both ways: a motion that lays the source on a part of the target leaves nothing one way. Trimmed, where the clouds
    overlap in part: the points without a partner say nothing.

    Args:
        source: (N, 3) float64, N >= 1.
        target: (M, 3) float64, M >= 1.
        overlap: Share of the smaller cloud's points that count, those with the nearest matches.
    """

    def __init__(self, source: NDArray[np.float64], target: NDArray[np.float64], overlap: float) -> None:
        self._source, self._target = source, target
        self._source_tree, self._target_tree = build_tree(source), build_tree(target)
        self._counted = max(int(np.ceil(overlap * min(len(source), len(target)))), 1)

    def residual(self, T_target_source: NDArray[np.float64]) -> float:
        """Return the mean of the squared distances, trimmed, of both ways together."""
        there = nearest_neighbours(*self._target_tree, transform(T_target_source, self._source))[1]
        back = nearest_neighbours(*self._source_tree, transform(invert(T_target_source), self._target))[1]
        return (self._least_mean(there) + self._least_mean(back)) / 2

    def inliers(self, T_target_source: NDArray[np.float64], reach: float) -> float:
        """Return the share of the source's points within a reach of the target: the largest common point set."""
        squares = nearest_neighbours(*self._target_tree, transform(T_target_source, self._source))[1]
        return float((squares <= reach**2).mean())

    def _least_mean(self, squares: NDArray[np.float64]) -> float:
        if self._counted < len(squares):
            squares = np.partition(squares, self._counted - 1)[: self._counted]
        return float(squares.mean())
