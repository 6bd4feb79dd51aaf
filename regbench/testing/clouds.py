"""The clouds and problems that the conformance battery asks methods to align."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regbench.contract import MotionPrior, Problem
from regbench.geometry.se3 import invert, rotation_from_euler_deg, se3, transform

Points = NDArray[np.float64]
Motion = NDArray[np.float64]

# A small motion: any method that registers at all finds it from the identity.
EASY_T_TARGET_SOURCE = se3(rotation_from_euler_deg((6.0, 3.0, 8.0)), (0.05, 0.02, -0.03))
EASY_PRIOR = MotionPrior((0.0,) * 3, (10.0,) * 3, (-0.1,) * 3, (0.1,) * 3)


def body(count: int, seed: int = 0) -> Points:
    """Return `count` points on a bumpy body without any symmetry, of about unit extent, (count, 3) float64."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z = directions.T
    radius = 0.7 + 0.2 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.15 * np.sin(5 * z + 2 * x) + 0.1 * np.cos(4 * y + 3 * z)
    points: Points = directions * radius[:, None] * (1.0, 0.75, 0.5)
    return points


def easy_problem(count: int = 600, *, cloud_seed: int = 0, seed: int = 7) -> tuple[Problem, Motion]:
    """Return an easy problem and its answer: the target is a moved copy of the source, in the same order."""
    source = body(count, cloud_seed)
    return make_problem(source, transform(EASY_T_TARGET_SOURCE, source), seed=seed), EASY_T_TARGET_SOURCE


def make_problem(
    source: Points,
    target: Points,
    *,
    seed: int = 7,
    prior: MotionPrior | None = EASY_PRIOR,
    init_T_target_source: Motion | None = None,
) -> Problem:
    """Return a problem on one thread of the CPU."""
    return Problem(
        source=source, target=target, motion_prior=prior, seed=seed, init_T_target_source=init_T_target_source
    )


def permuted_problem() -> tuple[Problem, Motion]:
    """Return the easy problem, both clouds in an order of their own."""
    problem, truth = easy_problem()
    rng = np.random.default_rng(1)
    return make_problem(rng.permutation(problem.source), rng.permutation(problem.target)), truth


def moved_problem() -> tuple[Problem, Motion]:
    """Return the easy problem seen from elsewhere: both clouds moved by one motion.

    It discloses no motion prior: the easy problem's would be wrong here.
    """
    problem, truth = easy_problem()
    elsewhere = se3(rotation_from_euler_deg((50.0, -30.0, 70.0)), (8.0, -5.0, 3.0))
    moved = make_problem(transform(elsewhere, problem.source), transform(elsewhere, problem.target), prior=None)
    return moved, elsewhere @ truth @ invert(elsewhere)


def scaled_problem(factor: float) -> tuple[Problem, Motion]:
    """Return the easy problem in another unit of length."""
    problem, truth = easy_problem()
    prior = MotionPrior(EASY_PRIOR.angle_min_deg, EASY_PRIOR.angle_max_deg, (-0.1 * factor,) * 3, (0.1 * factor,) * 3)
    scaled = make_problem(problem.source * factor, problem.target * factor, prior=prior)
    return scaled, se3(truth[:3, :3], truth[:3, 3] * factor)


def degenerate_problems() -> dict[str, Problem]:
    """Return problems without one answer, by name."""
    line = np.outer(np.linspace(-1, 1, 50), (1.0, 2.0, -0.5))
    clouds = {
        "one point": np.array([[0.1, 0.2, 0.3]]),
        "two points": np.array([[0.1, 0.2, 0.3], [-0.4, 0.1, 0.0]]),
        "all points equal": np.full((50, 3), 0.25),
        "a straight line": line,
        "a plane": body(200) * (1.0, 1.0, 0.0),
    }
    return {name: make_problem(cloud, transform(EASY_T_TARGET_SOURCE, cloud)) for name, cloud in clouds.items()}
