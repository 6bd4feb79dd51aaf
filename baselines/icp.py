"""Iterative closest point (Besl and McKay 1992; Chen and Medioni 1992): open3d's implementation, and our own."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem, Registrar, Registration
from regbench.errors import UserError
from regbench.geometry.icp import icp
from regbench.geometry.starts import Start, skip_without_prior, start_of

from .local_frame import LocalFrame, require_surface
from .open3d_library import import_open3d, point_cloud, point_to_point_icp
from .small_problem import small_problem


class Icp(Registrar):
    """Point-to-point or point-to-plane ICP.

    On several cores open3d sums in another order for "plane": its last bits repeat only where pinned to one core.

    Args:
        backend: "open3d"; or "numba", our own: exact nearest neighbours, point-to-point, faster, optionally trimmed.
        metric: "point" or "plane"; normals are estimated for "plane" where the problem has none.
        init: Where to start: "centroid" (centroids matched, no rotation), "identity", or "prior" (the mean rotation
            that the protocol discloses, centroids matched). A start given by the problem replaces the first two.
        max_distance: Farthest match, in extents of the target.
        max_iterations: Most iterations.
        tolerance: Stop when fitness and RMSE (in extents) change by less; "numba": RMSE, by this share of itself.
        overlap: Share of the source's points, those of the nearest matches, that count; "numba" alone.
        normal_neighbours: Points that a normal is estimated from.
    """

    name = "icp"
    requires = ("open3d",)
    # RPM-Net's published setting: identity start, point-to-point, 0.5, open3d's default of 30 iterations.
    presets: ClassVar = {
        "paper": {"metric": "point", "init": "identity", "max_distance": 0.5, "max_iterations": 30, "tolerance": 1e-6}
    }

    def __init__(
        self,
        *,
        backend: Literal["open3d", "numba"] = "open3d",
        metric: Literal["point", "plane"] = "point",
        init: Start = "centroid",
        max_distance: float = 2.0,
        max_iterations: int = 100,
        tolerance: float = 1e-8,
        overlap: float = 1.0,
        normal_neighbours: int = 30,
    ) -> None:
        self.backend = backend
        self.metric = metric
        self.init = init
        self.max_distance = max_distance
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.overlap = overlap
        self.normal_neighbours = normal_neighbours

    def prepare(self) -> None:
        """Import open3d, or compile: the first time on a machine that takes some twenty seconds.

        Raises:
            UserError: A parameter that the backend does not have.
        """
        if self.backend == "numba" and self.metric == "plane":
            raise UserError("icp: backend=numba is point-to-point; metric=plane needs backend=open3d")
        if self.backend == "open3d":
            if self.overlap != 1:
                raise UserError("icp: open3d's ICP does not trim; overlap needs backend=numba")
            import_open3d()
        else:
            Icp(backend="numba").register(small_problem())

    def skip(self, problem: Problem) -> str | None:
        """Decline problems without a motion prior if the start is taken from it."""
        return skip_without_prior(problem, self.init)

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud has no points, or too few for normals; or there is no prior to start from.
        """
        frame = LocalFrame.of(problem)
        start = start_of(problem, frame, self.init)
        if self.backend == "numba":
            return self._by_numba(frame, start)
        source, target = point_cloud(frame.source), point_cloud(frame.target)
        if self.metric == "plane":
            require_surface(problem)
            self._give_normals(target, problem.target_normals)
            result = self._point_to_plane(source, target, start)
        else:
            result = point_to_point_icp(
                source,
                target,
                start,
                max_distance=self.max_distance,
                max_iterations=self.max_iterations,
                tolerance=self.tolerance,
            )
        return Registration(
            T_target_source=frame.from_local(np.asarray(result.transformation)), confidence=result.fitness
        )

    def _by_numba(self, frame: LocalFrame, start: NDArray[np.float64]) -> Registration:
        found = icp(
            frame.source,
            frame.target,
            start,
            max_iterations=self.max_iterations,
            max_distance=self.max_distance,
            overlap=self.overlap,
            tolerance=self.tolerance,
        )
        return Registration(
            T_target_source=frame.from_local(found.T_target_source),
            converged=found.converged,
            iterations=found.iterations,
            confidence=found.matched,
        )

    def _give_normals(self, target: Any, normals: NDArray[np.float64] | None) -> None:
        open3d = import_open3d()
        if normals is not None:
            target.normals = open3d.utility.Vector3dVector(normals.copy())  # it refuses read-only arrays
        else:
            target.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(self.normal_neighbours))

    def _point_to_plane(self, source: Any, target: Any, start: NDArray[np.float64]) -> Any:
        registration = import_open3d().pipelines.registration
        return registration.registration_icp(
            source,
            target,
            self.max_distance,
            start,
            registration.TransformationEstimationPointToPlane(),
            registration.ICPConvergenceCriteria(self.tolerance, self.tolerance, self.max_iterations),
        )
