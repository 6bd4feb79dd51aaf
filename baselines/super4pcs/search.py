"""The search of Super 4PCS: bases of the source, their congruent sets in the target, the best motions among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.distance_grid import DistanceGrid
from regbench.geometry.se3 import se3

from .bases import PairLengths, draw_base
from .candidates import Candidates, Places, distinct
from .congruent import congruent_sets
from .fitting import motions_of
from .judgement import Judgement
from .pairs import pairs_at_distance
from .polishing import polished
from .random_state import seeded_state
from .verification import best_of, scores_of

# A motion that leaves less than this between the clouds, as a share of the reach, root mean square, cannot be bettered.
EXACT = 1e-3
# Largest gap between a base's segments, in deltas: with a gap, more sets are congruent by chance.
FLATNESS = 0.5
# Farthest matches of a candidate's steps of ICP, in reaches: first by a part of the points, then by all.
COARSE_STEPS, COARSE_POINTS = np.array([3.0, 3.0, 3.0, 2.25, 2.25, 1.5]), 256
FINE_STEPS = np.array([1.5, 1.5, 1.5])
# Motions that lay the points within this of each other, in reaches, are the same.
SAME = 0.5


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a search is told. Lengths are in the clouds' unit.

    Attributes:
        delta: Largest difference of a set from its base.
        copy_delta: The same for the first base, which looks for an exact copy; 0: no such base.
        reach: Largest distance at which a point counts as matched.
        widest: Largest distance within a base.
        max_bases: Most bases.
        max_sets: Most sets of one base.
        max_tests: Most comparisons of crossings of all bases, which bounds the time.
        kept: Candidates of each base.
        polish: Whether candidates are polished by steps of ICP.
        repeats: Bases that find the best motion before the search ends; 0: it does not end so.
        confidence: The search ends too where a base in the common points was drawn with this probability.
        seed: Of every random choice.
    """

    delta: float
    copy_delta: float
    reach: float
    widest: float
    max_bases: int
    max_sets: int
    max_tests: int
    kept: int
    polish: bool
    repeats: int
    confidence: float
    seed: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """What a search found.

    Attributes:
        motions: (S, 3, 4) float64, best score first; none where no base has a congruent set.
        bases: How many were drawn.
        sets: How many congruent sets they had.
        repeated: Bases that found the first motion.
        exact: Whether the first motion is exact.
    """

    motions: NDArray[np.float64]
    bases: int
    sets: int
    repeated: int
    exact: bool


def search(
    source: NDArray[np.float64], target: NDArray[np.float64], grid: DistanceGrid, judge: Judgement, settings: Settings
) -> Found:
    """Search the motion that lays the source on the target.

    Args:
        source: (N, 3) float64, in random order.
        target: (M, 3) float64, likewise: where limits cut a list short, what is left is a fair sample.
        grid: Of the target, or of a denser sampling of it.
        judge: Of the two clouds.
        settings: See there.
    """
    state, lengths = seeded_state(settings.seed), PairLengths.of(target, np.random.default_rng(settings.seed))
    source32, target32 = source.astype(np.float32), target.astype(np.float32)
    places, candidates = Places(source), Candidates(SAME * settings.reach)
    needed: float = settings.max_bases
    bases, sets_found, tests_left = 0, 0, settings.max_tests
    while bases < needed and tests_left > 0:
        looks_for_copy = bases == 0 and settings.copy_delta > 0
        delta = settings.copy_delta if looks_for_copy else settings.delta
        base = draw_base(source, settings.widest, FLATNESS * delta, lengths, state)
        if base is None:
            # A ring, for one, has only wider ones.
            base = draw_base(source, np.inf, FLATNESS * delta, lengths, state)
        if base is None:
            break
        bases += 1
        first, second = (
            pairs_at_distance(target32, max(length - delta, length / 2), length + delta) for length in base.lengths
        )
        sets, tests = congruent_sets(
            target32, first, second, base, delta, most=settings.max_sets, most_tests=tests_left
        )
        sets_found, tests_left = sets_found + len(sets), tests_left - tests
        if len(sets) == 0:
            continue
        motions, scores = best_of(motions_of(base.corners, target32, sets), source32, grid, settings.reach)
        if looks_for_copy and _is_exact(motions[0], judge, settings):
            return Found(motions=motions[:1], bases=bases, sets=sets_found, repeated=1, exact=True)
        chosen = distinct(places.of(motions), SAME * settings.reach, settings.kept)
        motions, scores = motions[chosen], scores[chosen]
        if settings.polish:
            motions = polished(motions, source32[:COARSE_POINTS], grid, COARSE_STEPS * settings.reach)
            motions = polished(motions, source32, grid, FINE_STEPS * settings.reach)
        candidates.add(motions, scores_of(motions, source32, grid, settings.reach), places.of(motions))
        if candidates.best.bases >= settings.repeats > 0:
            break
        needed = min(settings.max_bases, _bases_needed(candidates.best.score, settings.confidence))
    return Found(
        motions=np.array([candidate.motion for candidate in candidates]).reshape(-1, 3, 4),
        bases=bases,
        sets=sets_found,
        repeated=candidates.best.bases if len(candidates) else 0,
        exact=False,
    )


def _is_exact(motion: NDArray[np.float64], judge: Judgement, settings: Settings) -> bool:
    return judge.residual(se3(motion[:, :3], motion[:, 3])) < (EXACT * settings.reach) ** 2


def _bases_needed(common: float, confidence: float) -> float:
    """Return how many bases hold one of common points alone with a probability (RANSAC's rule).

    Args:
        common: Share of common points: the best score, which is a cautious estimate.
        confidence: The probability.
    """
    every = min(max(common, 0.0), 1.0) ** 4
    if every == 0.0:
        return np.inf
    return float(np.ceil(np.log(1 - confidence) / np.log1p(-every))) if every < 1.0 else 1.0
