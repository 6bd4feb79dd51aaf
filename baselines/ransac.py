"""RANSAC over matched FPFH features (Fischler and Bolles 1981; Rusu et al. 2009), open3d's implementation."""

from __future__ import annotations

from typing import Literal

import numpy as np

from regbench.contract import Problem, Registrar, Registration

from .fpfh import cloud_with_features, thinned
from .local_frame import LocalFrame, require_surface
from .open3d_library import final_icp, import_open3d, seed_open3d


class Ransac(Registrar):
    """RANSAC on FPFH matches, by default with a final ICP.

    Lengths are in extents of the target; those of the final ICP, in spacings of the target.

    open3d draws its samples in parallel: the answer is sure to repeat only where the process is pinned to one core, as
    the runner's workers are unless more threads are asked for.

    Args:
        max_points: A cloud with more points is thinned first: matching 100,000 features takes minutes.
        voxel: Edge of the voxels that a larger cloud is thinned to, one point each.
        normal_radius: Neighbourhood of a normal.
        normal_neighbours: Most neighbours of a normal.
        feature_radius: Neighbourhood of a feature.
        feature_neighbours: Most neighbours of a feature.
        orient_normals: Turn normals away from the centroid before features are computed.
        mutual: Keep only matches that are each other's nearest.
        max_distance: Farthest inlier.
        edge_similarity: Least ratio of matched edge lengths in a sample.
        max_iterations: Most samples.
        confidence: Stop when a better sample is this unlikely.
        refine: "icp" for a final point-to-point ICP, or "none".
        refine_distance: Farthest match of the final ICP, in spacings. Small, because where clouds overlap in part
            the points without a partner would pull.
        refine_iterations: Most iterations of the final ICP.
    """

    name = "ransac"
    requires = ("open3d",)

    def __init__(
        self,
        *,
        max_points: int = 5000,
        voxel: float = 0.03,
        normal_radius: float = 0.2,
        normal_neighbours: int = 30,
        feature_radius: float = 0.5,
        feature_neighbours: int = 100,
        orient_normals: bool = True,
        mutual: bool = True,
        max_distance: float = 0.05,
        edge_similarity: float = 0.9,
        max_iterations: int = 100_000,
        confidence: float = 0.999,
        refine: Literal["none", "icp"] = "icp",
        refine_distance: float = 2.0,
        refine_iterations: int = 60,
    ) -> None:
        self.max_points = max_points
        self.voxel = voxel
        self.normal_radius = normal_radius
        self.normal_neighbours = normal_neighbours
        self.feature_radius = feature_radius
        self.feature_neighbours = feature_neighbours
        self.orient_normals = orient_normals
        self.mutual = mutual
        self.max_distance = max_distance
        self.edge_similarity = edge_similarity
        self.max_iterations = max_iterations
        self.confidence = confidence
        self.refine = refine
        self.refine_distance = refine_distance
        self.refine_iterations = refine_iterations

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
            cloud_with_features(
                points if len(points) <= self.max_points else thinned(points, self.voxel),
                normal_radius=self.normal_radius,
                normal_neighbours=self.normal_neighbours,
                feature_radius=self.feature_radius,
                feature_neighbours=self.feature_neighbours,
                orient_normals=self.orient_normals,
            )
            for points in (frame.source, frame.target)
        )
        seed_open3d(problem.seed)
        registration = import_open3d().pipelines.registration
        result = registration.registration_ransac_based_on_feature_matching(
            source,
            target,
            source_features,
            target_features,
            self.mutual,
            self.max_distance,
            registration.TransformationEstimationPointToPoint(),
            3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(self.edge_similarity),
                registration.CorrespondenceCheckerBasedOnDistance(self.max_distance),
            ],
            registration.RANSACConvergenceCriteria(self.max_iterations, self.confidence),
        )
        if self.refine == "icp":
            result = final_icp(
                source, target, result, max_spacings=self.refine_distance, max_iterations=self.refine_iterations
            )
        return Registration(
            T_target_source=frame.from_local(np.asarray(result.transformation)), confidence=result.fitness
        )
