"""Sentinels: rows that say what a protocol can and cannot tell, not methods to use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.kabsch import kabsch
from regbench.geometry.se3 import se3


def _matching_centroids(problem: Problem, rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the motion with this rotation that maps the source's centroid onto the target's."""
    return se3(rotation, problem.target.mean(axis=0) - rotation @ problem.source.mean(axis=0))


class Identity(Registrar):
    """Answers the identity: what a failed trial is scored as."""

    name = "identity"
    kind = "sentinel"

    def register(self, problem: Problem) -> Registration:
        """Return no motion."""
        return Registration(T_target_source=np.eye(4))


class Random(Registrar):
    """Answers a rotation drawn uniformly from SO(3), centroids matched."""

    name = "random"
    kind = "sentinel"

    def register(self, problem: Problem) -> Registration:
        """Return a random rotation about the centroid, drawn from the problem's seed."""
        rotation = Rotation.random(rng=np.random.default_rng(problem.seed)).as_matrix()
        return Registration(T_target_source=_matching_centroids(problem, rotation))


class Oracle(Registrar):
    """Answers the ground truth, which the runner shows to it alone: the ceiling of every metric."""

    name = "oracle"
    kind = "sentinel"
    sees_ground_truth = True

    def register(self, problem: Problem) -> Registration:
        """Refuse: no ground truth is reachable from a problem.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError("the oracle needs the ground truth; the runner calls register_with_truth")

    def register_with_truth(self, problem: Problem, T_target_source: NDArray[np.float64]) -> Registration:
        """Return the (4, 4) ground truth."""
        return Registration(T_target_source=np.array(T_target_source, dtype=np.float64))

    def warm_up(self, problem: Problem) -> None:
        """Do nothing: there is nothing to warm up, and no truth to do it with."""


class Degenerate(Registrar):
    """Matches points by their rank in distance to the centroid and takes one Kabsch step.

    Exact, and the fastest, wherever the target is a moved copy of the source: it shows that such a protocol tells
    nothing about methods that look for correspondences.
    """

    name = "degenerate"
    kind = "sentinel"

    def register(self, problem: Problem) -> Registration:
        """Match ranks; the larger cloud is thinned evenly along its ranks.

        Raises:
            ValueError: A cloud has no points.
        """
        if min(len(problem.source), len(problem.target)) == 0:
            raise ValueError("a cloud has no points")
        source, target = _sorted_by_radius(problem.source), _sorted_by_radius(problem.target)
        count = min(len(source), len(target))
        return Registration(T_target_source=kabsch(_thinned(source, count), _thinned(target, count)))


def _sorted_by_radius(points: NDArray[np.float64]) -> NDArray[np.float64]:
    # Stable, so that points at equal distance keep the order they came in.
    return points[np.argsort(((points - points.mean(axis=0)) ** 2).sum(axis=1), kind="stable")]


def _thinned(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    if len(points) == count:
        return points
    return points[np.round(np.linspace(0, len(points) - 1, count)).astype(np.intp)]


class PriorMean(Registrar):
    """Answers the mean rotation that the protocol discloses, centroids matched: it looks at no shape."""

    name = "prior_mean"
    kind = "sentinel"

    def skip(self, problem: Problem) -> str | None:
        """Decline problems whose protocol discloses no motion prior."""
        return None if problem.motion_prior else "the protocol discloses no motion prior"

    def register(self, problem: Problem) -> Registration:
        """Return the mean motion.

        Raises:
            ValueError: The problem has no motion prior.
        """
        if problem.motion_prior is None:
            raise ValueError("prior_mean needs a motion prior, and the problem discloses none")
        return Registration(
            T_target_source=_matching_centroids(problem, problem.motion_prior.mean_T_target_source()[:3, :3])
        )
