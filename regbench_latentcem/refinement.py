"""What may follow the planner. It sees the two clouds, and no ground truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from regbench.contract import MotionPrior
from regbench.geometry.icp import icp
from regbench.geometry.kabsch import kabsch
from regbench.geometry.se3 import euler_deg_from_rotation, invert, rotation_from_euler_deg, se3, transform

Motion = NDArray[np.float64]
Points = NDArray[np.float64]

# How many of the ranked candidates are refined roughly, on so many points and with so many iterations, and how many of
# those to the end; the start is refined besides.
REFINED, FINISHED = 6, 2
RANKED_ON, ROUGH_ITERATIONS = 256, 20
# Distances, in spacings of the target, beyond which a point counts as one without a partner: generous where the clouds
# cover each other, narrow where only a part of them does.
WIDE, NARROW = 3.0, 1.0
# The clouds cover each other if so many of their points have a partner within four spacings.
COVERED = 0.985
# Of self-made pairs, resampled ones that cover each other reach a narrow residual within 0.03 of the best; crops, which
# can be made to cover each other by a wrong motion, do not.
AS_GOOD = 0.03
# Independent samples of a surface have a narrow residual of at least 0.81 spacings, whatever the motion.
A_COPY = 0.78
SOFT_ITERATIONS = 12
# Motions whose residuals differ by less cannot be told apart by them: of such, the one nearest to the start is taken.
TIE = 0.05
# An answer may lie so much outside a prior's range: ICP's own error.
MARGIN_DEG = 6.0
# Motions that differ by less are the same one after the last step; by half of it (and so much in place), before.
SAME_DEG = 10.0
SAME_PLACE = 0.05
# How many of the further candidates are ranked.
MOST_MORE = 24
# Rounding of residuals, in extents.
EXACT = 1e-9


@dataclass(frozen=True, eq=False)
class Verified:
    """The best of several motions.

    Attributes:
        T_target_source: (4, 4) float64.
        residual: Root mean square distance of nearest points, each at most `WIDE` or `NARROW` spacings.
        narrow: The same, at most `NARROW`.
        covered: Share of all points that have a partner within four spacings.
    """

    T_target_source: Motion
    residual: float
    narrow: float
    covered: float


class Residuals:
    """Distances of nearest points, from either cloud to the other, under a motion.

    Args:
        source: (N, 3).
        target: (M, 3).
    """

    def __init__(self, source: Points, target: Points) -> None:
        self._clouds = source, target
        self._trees = cKDTree(source), cKDTree(target)
        # Of distinct points: repeated ones are no nearer to each other than the surface is sampled.
        distinct = np.unique(target, axis=0)
        own = np.asarray(cKDTree(distinct).query(distinct, min(2, len(distinct)))[0])
        self.spacing = float(np.median(own.reshape(len(distinct), -1)[:, -1]))

    def distances(self, T: Motion, step: int = 1) -> Points:
        """Return the distances of every `step`-th point of both clouds, one after the other."""
        source, target = (cloud[::step] for cloud in self._clouds)
        forth = self._trees[1].query(transform(T, source))[0]
        back = self._trees[0].query(transform(invert(T), target))[0]
        return np.concatenate([np.asarray(forth), np.asarray(back)])

    def verified(self, T: Motion, counted: float) -> Verified:
        """Return what there is to say of a motion, its residual truncated at `counted` spacings."""
        distances = self.distances(T)
        covered = float(np.mean(distances < 4 * self.spacing)) if self.spacing else 1.0
        return Verified(T, self.truncated(distances, counted), self.truncated(distances, NARROW), covered)

    def softly_refined(self, T: Motion) -> Motion:
        """Return the motion of a copy after ICP with soft matches (EM-ICP; Granger and Pennec 2002), both ways.

        The nearest point of a noisy copy is often not the partner. So a point is matched to the mean of the nearest
        eight, weighted by the likelihood that noise put them there; the noise is estimated from the distances.
        """
        source, target = self._clouds
        for _ in range(SOFT_ITERATIONS):
            to_target = _soft_matches(self._trees[1], transform(T, source))
            to_source = _soft_matches(self._trees[0], transform(invert(T), target))
            T = kabsch(np.concatenate([source, to_source]), np.concatenate([to_target, target]))
        return T

    def truncated(self, distances: Points, spacings: float) -> float:
        """Return the root mean square of distances of which none counts more than so many spacings.

        A target of one point has no spacing: there all of them count.
        """
        most = spacings * self.spacing if self.spacing else np.inf
        return float(np.sqrt(np.mean(np.minimum(distances, most) ** 2)))


def _soft_matches(tree: cKDTree, points: Points) -> Points:
    """Return the mean of the nearest eight points of the tree, weighted by their likelihood: (N, 3)."""
    distances, nearest = (np.asarray(found) for found in tree.query(points, min(8, tree.n)))
    distances, nearest = distances.reshape(len(points), -1), nearest.reshape(len(points), -1)
    # The nearest point is nearer than the partner: twice its mean square, measured on noisy copies.
    variance = 2 * np.mean(distances[:, 0] ** 2) / 3 + EXACT**2
    weights = np.exp((distances[:, :1] ** 2 - distances**2) / (2 * variance))
    weights /= weights.sum(axis=1, keepdims=True)
    means: Points = (weights[:, :, None] * np.asarray(tree.data)[nearest]).sum(axis=1)
    return means


def verified(
    candidates: Sequence[Motion],
    source: Points,
    target: Points,
    icp_iterations: int,
    *,
    more: Callable[[], Sequence[Motion]] = lambda: (),
    allowed: Callable[[Motion], bool] = lambda T: True,
) -> Verified:
    """Return the best of several motions after ICP.

    The candidates are ranked by the Chamfer distance (squared, truncated, on a part of the points), the first ones are
    refined by ICP, and the one of least residual is the answer; among those as good, the nearest to the start. This is
    done twice: for clouds that share a part, with near pairs alone, and for clouds that cover each other, with all.
    The second answer is taken if it covers the clouds and is, by the measure of the first, as good.

    Args:
        candidates: (4, 4) motions T_target_source; the first is the start, which is always refined.
        source: (N, 3).
        target: (M, 3).
        icp_iterations: Most iterations of ICP.
        more: Makes further candidates. It is not asked if the second candidate ends at what only a copy can have.
        allowed: Which motions may be answered, besides what the start becomes.
    """
    of = Residuals(source, target)

    def refined(T: Motion, reach: float, iterations: int, step: int = 1) -> Motion:
        far = reach * of.spacing if of.spacing else np.inf
        return icp(source[::step], target, T, max_iterations=iterations, max_distance=far).T_target_source

    first = of.verified(refined(candidates[:2][-1], np.inf, icp_iterations), WIDE)
    if allowed(first.T_target_source) and first.covered >= COVERED and first.narrow < A_COPY * of.spacing:
        return of.verified(of.softly_refined(first.T_target_source), WIDE)
    start, rest = candidates[0], [T for T in candidates[1:] if allowed(T)]
    rest += _distinct([T for T in more() if allowed(T)], MOST_MORE)
    step = -(-max(len(source), len(target)) // RANKED_ON)
    coarse = [(T, of.distances(T, step)) for T in rest]

    def best(reach: float, counted: float) -> Verified:
        """Refine the candidates that are best when pairs up to `reach` count; judge by distances up to `counted`."""
        ranked = sorted(coarse, key=lambda pair: of.truncated(pair[1], min(reach, 1.5 * counted)))
        chosen = [start, *_distinct([T for T, _ in ranked], REFINED)]
        rough = [refined(T, reach, ROUGH_ITERATIONS, step) for T in chosen]
        rough[1:] = sorted(rough[1:], key=lambda T: of.truncated(of.distances(T), counted))[:FINISHED]
        motions = [refined(T, reach, icp_iterations) for T in rough]
        return _nearest_of_the_best(
            [of.verified(T, counted) for k, T in enumerate(motions) if k == 0 or allowed(T)], start
        )

    partly, wholly = best(1.5, NARROW), best(np.inf, WIDE)
    as_good = wholly.narrow <= (1 + AS_GOOD) * partly.narrow + EXACT
    return wholly if wholly.covered >= COVERED and as_good else partly


def _distinct(motions: Sequence[Motion], most: int) -> list[Motion]:
    """Return the first motions that are not nearly the same as one before."""
    chosen: list[Motion] = []
    for T in motions:
        if len(chosen) == most:
            break
        if all(angle_deg(T, other) > SAME_DEG / 2 or _distance(T, other) > SAME_PLACE for other in chosen):
            chosen.append(T)
    return chosen


def _nearest_of_the_best(found: Sequence[Verified], start: Motion) -> Verified:
    """Return the motion of least residual, or one as good that turns less from the start."""
    least = min(each.residual for each in found)
    tied = [each for each in found if each.residual <= (1 + TIE) * least + EXACT]
    nearest = min(tied, key=lambda each: angle_deg(each.T_target_source, start))
    same = [each for each in tied if angle_deg(each.T_target_source, nearest.T_target_source) < SAME_DEG]
    return min(same, key=lambda each: each.residual)


def _distance(first: Motion, second: Motion) -> float:
    return float(np.linalg.norm(first[:3, 3] - second[:3, 3]))


def octants(prior: MotionPrior) -> list[Motion]:
    """Return the rotations at the middles of the eight parts of a prior's range, centroids matched."""
    least, greatest = np.array(prior.angle_min_deg), np.array(prior.angle_max_deg)
    shares = 0.25 + 0.5 * np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(8, 3)
    return [se3(rotation_from_euler_deg(least + share * (greatest - least)), np.zeros(3)) for share in shares]


def inside(prior: MotionPrior, T_target_source: Motion) -> bool:
    """Return whether a motion's angles are in a prior's range, or off it by no more than `MARGIN_DEG`."""
    angles = euler_deg_from_rotation(T_target_source[:3, :3])
    above = angles >= np.array(prior.angle_min_deg) - MARGIN_DEG
    below = angles <= np.array(prior.angle_max_deg) + MARGIN_DEG
    return bool((above & below).all())


def angle_deg(first: Motion, second: Motion) -> float:
    """Return the angle between the rotations of two (4, 4) motions."""
    cosine = (np.sum(first[:3, :3] * second[:3, :3]) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
