"""ICP, point-to-plane ICP, GICP and voxelised GICP of the small_gicp package (Koide 2024)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.starts import Start, skip_without_prior, start_of

from .local_frame import LocalFrame, require_surface


class SmallGicp(Registrar):
    """small_gicp's registration of two clouds, by default without down-sampling.

    Args:
        registration_type: "ICP", "PLANE_ICP", "GICP" or "VGICP".
        init: Where to start: "centroid", "identity" or "prior", as for `icp`.
        max_distance: Farthest match, in extents of the target.
        max_iterations: Most iterations.
        neighbours: Points that a covariance or normal is estimated from.
        downsampling: Voxel that clouds are thinned by, in extents of the target; 0 keeps every point.
        voxel: Voxel of the target's map for VGICP, in extents of the target.
        tolerance: Stop when an update rotates by less (radians) and moves by less (extents).
    """

    name = "small_gicp"
    requires = ("small_gicp",)

    def __init__(
        self,
        *,
        registration_type: Literal["ICP", "PLANE_ICP", "GICP", "VGICP"] = "GICP",
        init: Start = "centroid",
        max_distance: float = 2.0,
        max_iterations: int = 100,
        neighbours: int = 20,
        downsampling: float = 0.0,
        voxel: float = 0.25,
        tolerance: float = 1e-4,
    ) -> None:
        self.registration_type = registration_type
        self.init = init
        self.max_distance = max_distance
        self.max_iterations = max_iterations
        self.neighbours = neighbours
        self.downsampling = downsampling
        self.voxel = voxel
        self.tolerance = tolerance

    def prepare(self) -> None:
        """Import small_gicp."""
        import small_gicp  # noqa: F401

    def skip(self, problem: Problem) -> str | None:
        """Decline problems without a motion prior if the start is taken from it."""
        return skip_without_prior(problem, self.init)

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud has fewer than three distinct points; or there is no prior to start from.
        """
        import small_gicp

        require_surface(problem)
        frame = LocalFrame.of(problem)
        threads = problem.threads
        source, target = (self._thinned(points, threads) for points in (frame.source, frame.target))
        target_tree = small_gicp.KdTree(target, num_threads=threads)
        if self.registration_type != "ICP":
            small_gicp.estimate_normals_covariances(target, target_tree, self.neighbours, threads)
        if self.registration_type in ("GICP", "VGICP"):
            source_tree = small_gicp.KdTree(source, num_threads=threads)
            small_gicp.estimate_covariances(source, source_tree, self.neighbours, threads)
        options = {
            "init_T_target_source": start_of(problem, frame, self.init),
            "max_correspondence_distance": self.max_distance,
            "num_threads": threads,
            "max_iterations": self.max_iterations,
            "rotation_epsilon": self.tolerance,
            "translation_epsilon": self.tolerance,
        }
        if self.registration_type == "VGICP":
            voxels = small_gicp.GaussianVoxelMap(self.voxel)
            voxels.insert(target)
            result = small_gicp.align(voxels, source, **options)
        else:
            result = small_gicp.align(target, source, target_tree, registration_type=self.registration_type, **options)
        return Registration(
            T_target_source=frame.from_local(np.asarray(result.T_target_source)),
            converged=bool(result.converged),
            iterations=int(result.iterations),
        )

    def _thinned(self, points: np.ndarray, threads: int) -> object:
        import small_gicp

        if self.downsampling == 0:
            return small_gicp.PointCloud(points)
        return small_gicp.voxelgrid_sampling(points, self.downsampling, threads)
