"""ICP from many starts, the answer of least Chamfer distance: what searching without a model is worth."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.chamfer import chamfer_distance
from regbench.geometry.icp import icp
from regbench.geometry.se3 import rotation_from_euler_deg, se3, transform
from regbench.geometry.starts import skip_without_prior, start_of

from .local_frame import LocalFrame
from .small_problem import small_problem

Motion = NDArray[np.float64]


class IcpRestarts(Registrar):
    """Point-to-point ICP from matched centroids (or the problem's start), then from random rotations about them.

    The first start is always tried. Further ones are drawn from the problem's seed until one of the two limits is
    met. Within a time budget the number of starts, and so the answer, depends on the machine and its load; with
    `budget_ms=None` the answer repeats to the last bit.

    Args:
        starts: Where the random rotations come from: "uniform", all of SO(3); or "prior", the range of motions that
            the protocol discloses.
        budget_ms: Time for all of it, in milliseconds: no start is begun that would, at the mean time of those
            before, end later. None: no such limit.
        restarts: Most random starts. None: no such limit.
        max_distance: Farthest match, in extents of the target.
        max_iterations: Most iterations of each ICP.
        tolerance: An ICP stops when its RMSE falls by less than this share of itself.
    """

    name = "icp_restarts"
    deterministic = False

    def __init__(
        self,
        *,
        starts: Literal["uniform", "prior"] = "uniform",
        budget_ms: float | None = 100.0,
        restarts: int | None = None,
        max_distance: float = 2.0,
        max_iterations: int = 100,
        tolerance: float = 1e-8,
    ) -> None:
        self.starts = starts
        self.budget_ms = budget_ms
        self.restarts = restarts
        self.max_distance = max_distance
        self.max_iterations = max_iterations
        self.tolerance = tolerance

    def prepare(self) -> None:
        """Compile: see `Icp.prepare`."""
        IcpRestarts(budget_ms=None, restarts=1).register(small_problem())

    def skip(self, problem: Problem) -> str | None:
        """Decline problems without a motion prior if the starts are drawn from it."""
        reason = skip_without_prior(problem, "prior" if self.starts == "prior" else "centroid")
        return reason and reason.replace("init=", "starts=")

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Returns:
            The `confidence` is minus the Chamfer distance in extents of the target; `iterations` counts the starts.

        Raises:
            ValueError: A cloud has no points, there is no prior to draw from, or neither limit is given.
        """
        if self.budget_ms is None and self.restarts is None:
            raise ValueError("icp_restarts needs a limit: budget_ms or restarts")
        began = time.perf_counter()
        frame = LocalFrame.of(problem)
        least, answer, tried = np.inf, np.eye(4), 0
        for start in self._starts(problem, frame):
            if tried and not self._has_time_for_one_more(time.perf_counter() - began, tried):
                break
            T_local = icp(
                frame.source,
                frame.target,
                start,
                max_distance=self.max_distance,
                max_iterations=self.max_iterations,
                tolerance=self.tolerance,
            ).T_target_source
            distance = chamfer_distance(transform(T_local, frame.source), frame.target)
            tried += 1
            if distance < least:
                least, answer = distance, T_local
        return Registration(T_target_source=frame.from_local(answer), iterations=tried, confidence=-least)

    def _starts(self, problem: Problem, frame: LocalFrame) -> Iterator[Motion]:
        """Yield the starts in the local frame: the first, then as many random ones as are allowed."""
        yield start_of(problem, frame, "centroid")
        rng = np.random.default_rng(problem.seed)
        for rotation in islice(self._rotations(problem, rng), self.restarts):
            yield se3(rotation, np.zeros(3))

    def _rotations(self, problem: Problem, rng: np.random.Generator) -> Iterator[Motion]:
        prior = problem.motion_prior
        if self.starts == "prior" and prior is None:
            raise ValueError("starts=prior needs a motion prior, and the problem discloses none")
        while True:
            if self.starts == "prior" and prior is not None:
                yield rotation_from_euler_deg(rng.uniform(prior.angle_min_deg, prior.angle_max_deg))
            else:
                yield Rotation.random(rng=rng).as_matrix()

    def _has_time_for_one_more(self, elapsed_s: float, tried: int) -> bool:
        return self.budget_ms is None or elapsed_s * (tried + 1) / tried <= self.budget_ms / 1000
