"""Wide bases: four points of the source, nearly in one plane, whose two segments cross."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .random_state import below

# Of so many points, the farthest within the limit is the first one's partner.
PARTNERS = 30
# So many first segments are tried, and so many second ones for each.
FIRST_SEGMENTS, SECOND_SEGMENTS = 8, 400
# The least squared sine of the angle between the segments, what is left of each on either side of the crossing, and
# the least length of the second as a share of the first.
LEAST_SINE_SQUARED, LEAST_SHARE, LEAST_LENGTH = 0.3, 0.1, 0.3
# Lengths of the target's pairs are counted in so many bins, from so many random pairs.
BINS, SAMPLES = 64, 10_000


class Base(NamedTuple):
    """Four points and what no rigid motion changes of them (Aiger et al. 2008, section 3).

    Attributes:
        corners: (4, 3) float64; the segments are 0-1 and 2-3.
        lengths: (2,) float64, of the two segments.
        ratios: (2,) float64, where the segments come nearest to each other, as shares of them.
        gap: How near; 0 where the four lie in one plane.
        cosine: Of the angle between the segments.
    """

    corners: NDArray[np.float64]
    lengths: NDArray[np.float64]
    ratios: NDArray[np.float64]
    gap: float
    cosine: float

    @classmethod
    def of(cls, corners: NDArray[np.float64]) -> Base:
        """Return four points, (4, 3), whose segments are not parallel, as a base."""
        segments = np.array([corners[1] - corners[0], corners[3] - corners[2]])
        lengths = np.sqrt((segments**2).sum(axis=1))
        first, second, gap = _crossing(corners, 0, 1, 2, 3)
        return cls(corners, lengths, np.array([first, second]), gap, segments[0] @ segments[1] / lengths.prod())


class PairLengths(NamedTuple):
    """How many pairs of a cloud have which length, about.

    Attributes:
        counts: (BINS + 1,) float64.
        width: Of a bin.
    """

    counts: NDArray[np.float64]
    width: float

    @classmethod
    def of(cls, points: NDArray[np.float64], rng: np.random.Generator) -> PairLengths:
        """Estimate from random pairs of (N, 3) points."""
        ends = rng.integers(0, len(points), (2, SAMPLES))
        lengths = np.sqrt(((points[ends[0]] - points[ends[1]]) ** 2).sum(axis=1))
        width = (float(lengths.max()) or 1.0) / BINS
        # No bin is empty: a length that no sampled pair has is rare, not impossible.
        counts = np.bincount((lengths / width).astype(np.int64), minlength=BINS + 1)
        return cls((counts + 1).astype(np.float64), width)


def draw_base(
    points: NDArray[np.float64], widest: float, flatness: float, lengths: PairLengths, state: NDArray[np.uint64]
) -> Base | None:
    """Draw a base; of those met, the one whose lengths are rarest in the target.

    The fewer pairs of the target have the lengths of its segments, the fewer sets are congruent to it by chance. Wide
    bases have rare lengths, so they are preferred without a rule of their own.

    Args:
        points: (N, 3) float64, the source.
        widest: Largest distance between two of the four points: farther points are rarely both in the overlap.
        flatness: Largest gap between the segments; where there is no such base, the flattest one met is taken.
        lengths: Of the target.
        state: Of the random generator; changed.

    Returns:
        None where no two segments cross: there are fewer than four points, or all lie on a line.
    """
    indices, found = _draw(points, widest, flatness, lengths.counts, lengths.width, state)
    return Base.of(points[indices]) if found else None


@njit(cache=True)
def _draw(
    points: NDArray[np.float64],
    widest: float,
    flatness: float,
    counts: NDArray[np.float64],
    width: float,
    state: NDArray[np.uint64],
) -> tuple[NDArray[np.int64], bool]:
    """Return the indices of the base, (4,), and whether there is one."""
    best, least_gap, least_cost = np.zeros(4, np.int64), np.inf, np.inf
    for _ in range(FIRST_SEGMENTS):
        a, b, first = below(state, len(points)), -1, 0.0
        for _ in range(PARTNERS):
            other = below(state, len(points))
            length = _distance(points, a, other)
            if first < length <= widest:
                b, first = other, length
        if b < 0:
            continue
        for _ in range(SECOND_SEGMENTS):
            c, d = below(state, len(points)), below(state, len(points))
            second = _distance(points, c, d)
            if not LEAST_LENGTH * first <= second <= widest or not _within(points, a, b, c, d, widest):
                continue
            one, two, gap = _crossing(points, a, b, c, d)
            if min(one, two) < LEAST_SHARE or max(one, two) > 1 - LEAST_SHARE:
                continue
            cost = counts[min(int(first / width), BINS)] * counts[min(int(second / width), BINS)]
            # Flat ones are compared by cost, others by their gap.
            gap = max(gap - flatness, 0.0)
            if gap < least_gap or (gap == least_gap and cost < least_cost):
                best[0], best[1], best[2], best[3] = a, b, c, d
                least_gap, least_cost = gap, cost
    return best, least_cost < np.inf


@njit(cache=True)
def _distance(points: NDArray[np.float64], i: int, j: int) -> float:
    square = 0.0
    for axis in range(3):
        square += (points[i, axis] - points[j, axis]) ** 2
    return float(np.sqrt(square))


@njit(cache=True)
def _within(points: NDArray[np.float64], a: int, b: int, c: int, d: int, widest: float) -> bool:
    """Return whether no end of one segment is farther than `widest` from an end of the other."""
    return (
        _distance(points, a, c) <= widest
        and _distance(points, a, d) <= widest
        and _distance(points, b, c) <= widest
        and _distance(points, b, d) <= widest
    )


@njit(cache=True)
def _crossing(points: NDArray[np.float64], a: int, b: int, c: int, d: int) -> tuple[float, float, float]:
    """Return where the lines a-b and c-d come nearest to each other, as shares of the segments, and how near.

    Lines that are too nearly parallel, or points that coincide, give -1, -1 and infinity.
    """
    aa, bb, ab, ar, br = 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        u, v, r = (
            points[b, axis] - points[a, axis],
            points[d, axis] - points[c, axis],
            points[a, axis] - points[c, axis],
        )
        aa += u * u
        bb += v * v
        ab += u * v
        ar += u * r
        br += v * r
    determinant = aa * bb - ab * ab
    if determinant <= LEAST_SINE_SQUARED * aa * bb:
        return -1.0, -1.0, np.inf
    one, two = (ab * br - bb * ar) / determinant, (aa * br - ab * ar) / determinant
    square = 0.0
    for axis in range(3):
        u, v, r = (
            points[b, axis] - points[a, axis],
            points[d, axis] - points[c, axis],
            points[a, axis] - points[c, axis],
        )
        square += (r + one * u - two * v) ** 2
    return one, two, np.sqrt(square)
