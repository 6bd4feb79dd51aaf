"""What methods on matched FPFH features share: all but the search for the motion."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem, Registrar, Registration

from .flat import is_flat, principal_starts
from .fpfh import cloud_with_features, thinned
from .local_frame import LocalFrame, require_surface
from .open3d_library import final_icp, import_open3d, seed_open3d


class FeatureRegistrar(Registrar):
    """A method that searches the motion among matched features, by default with a final ICP.

    Attributes:
        max_points: A cloud with more points is thinned first: matching 100,000 features takes minutes.
        voxel: Edge of the voxels that a larger cloud is thinned to, one point each.
        normal_radius: Neighbourhood of a normal.
        normal_neighbours: Most neighbours of a normal.
        feature_radius: Neighbourhood of a feature.
        feature_neighbours: Most neighbours of a feature.
        orient_normals: Turn normals away from the centroid before features are computed.
        flat: What to do where both clouds lie in a plane, all points of which have the same feature: "axes" tries the
            four motions that match principal axes and keeps the best, "features" goes on as ever.
        refine: "icp" for a final point-to-point ICP, or "none".
        refine_distance: Farthest match of the final ICP, in spacings. Small, because where clouds overlap in part
            the points without a partner would pull.
        refine_iterations: Most iterations of the final ICP.
    """

    requires = ("open3d",)
    max_points: int
    voxel: float
    normal_radius: float
    normal_neighbours: int
    feature_radius: float
    feature_neighbours: int
    orient_normals: bool
    max_distance: float
    flat: Literal["axes", "features"]
    refine: Literal["none", "icp"]
    refine_distance: float
    refine_iterations: int

    def prepare(self) -> None:
        """Import open3d."""
        import_open3d()

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud has fewer than three distinct points.
        """
        require_surface(problem)
        frame = LocalFrame.of(problem)
        (source, source_features), (target, target_features) = (
            self._features(frame.source),
            self._features(frame.target),
        )
        if self.flat == "axes" and is_flat(frame.source) and is_flat(frame.target):
            starts = principal_starts(frame.source, frame.target)
            results = [self._evaluated(source, target, start) for start in starts]
        else:
            seed_open3d(problem.seed)
            results = [self.search(source, target, source_features, target_features)]
        if self.refine == "icp":
            distance, iterations = self.refine_distance, self.refine_iterations
            results = [
                final_icp(source, target, result, max_spacings=distance, max_iterations=iterations)
                for result in results
            ]
        best = max(results, key=lambda result: (result.fitness, -result.inlier_rmse))
        return Registration(T_target_source=frame.from_local(np.asarray(best.transformation)), confidence=best.fitness)

    @abstractmethod
    def search(self, source: Any, target: Any, source_features: Any, target_features: Any) -> Any:
        """Return open3d's RegistrationResult for two clouds with their features."""

    def _features(self, points: NDArray[np.float64]) -> tuple[Any, Any]:
        return cloud_with_features(
            points if len(points) <= self.max_points else thinned(points, self.voxel),
            normal_radius=self.normal_radius,
            normal_neighbours=self.normal_neighbours,
            feature_radius=self.feature_radius,
            feature_neighbours=self.feature_neighbours,
            orient_normals=self.orient_normals,
        )

    def _evaluated(self, source: Any, target: Any, start: NDArray[np.float64]) -> Any:
        return import_open3d().pipelines.registration.evaluate_registration(source, target, self.max_distance, start)
