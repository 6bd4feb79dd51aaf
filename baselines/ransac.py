"""RANSAC over matched FPFH features (Fischler and Bolles 1981; Rusu et al. 2009), open3d's implementation."""

from __future__ import annotations

from typing import Any, Literal

from .feature_registrar import FeatureRegistrar
from .open3d_library import import_open3d


class Ransac(FeatureRegistrar):
    """RANSAC on FPFH matches, by default with a final ICP.

    Lengths are in extents of the target; those of the final ICP, in spacings of the target.

    open3d draws its samples in parallel: the answer is sure to repeat only where the process is pinned to one core, as
    the runner's workers are unless more threads are asked for.

    Args (those of FeatureRegistrar beside):
        mutual: Keep only matches that are each other's nearest.
        max_distance: Farthest inlier.
        edge_similarity: Least ratio of matched edge lengths in a sample.
        max_iterations: Most samples.
        confidence: Stop when a better sample is this unlikely.
    """

    name = "ransac"

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
        flat: Literal["axes", "features"] = "axes",
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
        self.flat = flat
        self.refine = refine
        self.refine_distance = refine_distance
        self.refine_iterations = refine_iterations

    def search(self, source: Any, target: Any, source_features: Any, target_features: Any) -> Any:
        """Search the motion; see FeatureRegistrar."""
        registration = import_open3d().pipelines.registration
        return registration.registration_ransac_based_on_feature_matching(
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
