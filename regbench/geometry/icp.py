"""Point-to-point ICP with exact nearest neighbours, compiled: a method of its own and the last step of others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.matches import add_match, fit_matches, moved_point
from regbench.geometry.nearest_tree import DEEPEST, build_tree, nearest_in_tree
from regbench.geometry.se3 import se3


@dataclass(frozen=True, eq=False)
class IcpResult:
    """Where ICP ended.

    Attributes:
        T_target_source: (4, 4) float64.
        iterations: Motions computed.
        converged: Whether the matches stopped changing (every further iteration would answer the same), or the
            residual by more than the tolerance.
        residual: Root mean square distance of the last matches, before the last motion; NaN without any.
        matched: Share of the source's points among them.
    """

    T_target_source: NDArray[np.float64]
    iterations: int
    converged: bool
    residual: float
    matched: float


def icp(
    source: NDArray[np.float64],
    target: NDArray[np.float64],
    start: NDArray[np.float64],
    *,
    max_iterations: int = 100,
    max_distance: float = np.inf,
    overlap: float = 1.0,
    tolerance: float = 0.0,
) -> IcpResult:
    """Align two clouds by point-to-point ICP (Besl and McKay 1992).

    Args:
        source: (N, 3), N >= 1.
        target: (M, 3), M >= 1.
        start: (4, 4) first guess of T_target_source.
        max_iterations: Most motions computed.
        max_distance: Pairs farther apart are left out; where fewer than three are left, the motion so far is the
            answer.
        overlap: Share of the source's points, those of the nearest matches, that count (trimmed ICP, Chetverikov et
            al. 2002).
        tolerance: Stop where the residual falls by less than this share of itself; 0: where matches do not change.

    Raises:
        ValueError: A cloud has no points or some that are not finite, or overlap is not in (0, 1].
    """
    for cloud in (source, target):
        if len(cloud) == 0 or not np.isfinite(cloud).all():
            raise ValueError("icp needs points in both clouds, all of them finite")
    if not 0 < overlap <= 1:
        raise ValueError(f"overlap is a share in (0, 1], got {overlap}")
    tree, _, axes = build_tree(np.ascontiguousarray(target, dtype=np.float64))
    rotation, translation = (np.array(part, dtype=np.float64) for part in (start[:3, :3], start[:3, 3]))
    iterations, converged, residual, matched = _iterate(
        np.ascontiguousarray(source, dtype=np.float64),
        tree,
        axes,
        rotation,
        translation,
        max_iterations,
        max_distance,
        overlap,
        tolerance,
    )
    return IcpResult(se3(rotation, translation), iterations, converged, residual, matched)


@njit(cache=True)
def _iterate(
    source: NDArray[np.float64],
    tree: NDArray[np.float64],
    axes: NDArray[np.int8],
    rotation: NDArray[np.float64],
    translation: NDArray[np.float64],
    max_iterations: int,
    max_distance: float,
    overlap: float,
    tolerance: float,
) -> tuple[int, bool, float, float]:
    """Change the motion in place; return iterations, whether it converged, the residual, and the share of matches."""
    count = len(source)
    places, before = np.zeros(count, np.int64), np.full(count, -1, np.int64)
    squares = np.empty(count)
    sums, products = np.empty((2, 3)), np.empty((3, 3))
    lows, highs, beyond = np.empty(DEEPEST, np.int64), np.empty(DEEPEST, np.int64), np.empty(DEEPEST)
    kept = int(np.ceil(overlap * count))
    residual, matched = np.nan, 0
    for iteration in range(max_iterations):
        place, changed = places[0], False
        for index in range(count):
            x, y, z = moved_point(rotation, translation, source, index)
            # Its match before, or its neighbour's in the first iteration.
            guess = places[index] if iteration else place
            place, squares[index] = nearest_in_tree(tree, axes, x, y, z, guess, lows, highs, beyond)
            places[index] = place
        farthest = max_distance * max_distance
        if kept < count:
            farthest = min(farthest, np.partition(squares, kept - 1)[kept - 1])
        total, matched = 0.0, 0
        sums[:] = 0.0
        products[:] = 0.0
        for index in range(count):
            match = places[index] if squares[index] <= farthest else -2
            if match != before[index]:
                changed = True
                before[index] = match
            if match >= 0:
                total += squares[index]
                matched += 1
                add_match(sums, products, source, index, tree, match)
        if not changed:
            return iteration, True, residual, matched / count
        if matched < 3 and max_distance < np.inf:
            return iteration, False, residual, matched / count
        now = np.sqrt(total / matched)
        fit_matches(sums, products, matched, source, tree, rotation, translation)
        if tolerance > 0 and residual - now < tolerance * residual:
            return iteration + 1, True, now, matched / count
        residual = now
    return max_iterations, False, residual, matched / count
