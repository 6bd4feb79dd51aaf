"""Generalized ICP (Segal, Haehnel and Thrun 2009), open3d's implementation."""

from __future__ import annotations

import numpy as np

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.starts import Start, skip_without_prior, start_of

from .local_frame import LocalFrame, require_surface
from .open3d_library import import_open3d, point_cloud


class Gicp(Registrar):
    """Generalized ICP: plane-to-plane.

    open3d sums in another order on several cores: the last bits repeat only where the process is pinned to one.

    Args:
        init: Where to start: "centroid", "identity" or "prior", as for `icp`.
        max_distance: Farthest match, in extents of the target.
        max_iterations: Most iterations.
        tolerance: Stop when fitness and RMSE (in extents) change by less.
        neighbours: Points that a normal is estimated from.
        epsilon: Variance along a surface's normal, that in its plane being 1.
    """

    name = "gicp"
    requires = ("open3d",)

    def __init__(
        self,
        *,
        init: Start = "centroid",
        max_distance: float = 2.0,
        max_iterations: int = 100,
        tolerance: float = 1e-6,
        neighbours: int = 20,
        epsilon: float = 1e-3,
    ) -> None:
        self.init = init
        self.max_distance = max_distance
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.neighbours = neighbours
        self.epsilon = epsilon

    def prepare(self) -> None:
        """Import open3d."""
        import_open3d()

    def skip(self, problem: Problem) -> str | None:
        """Decline problems without a motion prior if the start is taken from it."""
        return skip_without_prior(problem, self.init)

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud has fewer than three distinct points; or there is no prior to start from.
        """
        require_surface(problem)
        open3d = import_open3d()
        frame = LocalFrame.of(problem)
        source, target = point_cloud(frame.source), point_cloud(frame.target)
        # open3d makes the regularised covariances from normals. Those of estimate_covariances it would take as they
        # are, singular on every flat patch.
        for cloud in (source, target):
            cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(self.neighbours))
        registration = open3d.pipelines.registration
        result = registration.registration_generalized_icp(
            source,
            target,
            self.max_distance,
            start_of(problem, frame, self.init),
            registration.TransformationEstimationForGeneralizedICP(self.epsilon),
            registration.ICPConvergenceCriteria(self.tolerance, self.tolerance, self.max_iterations),
        )
        return Registration(
            T_target_source=frame.from_local(np.asarray(result.transformation)), confidence=result.fitness
        )
