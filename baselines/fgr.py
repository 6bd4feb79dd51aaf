"""Fast global registration (Zhou, Park and Koltun 2016) on FPFH features, open3d's implementation."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from .feature_registrar import FeatureRegistrar
from .open3d_library import import_open3d


class Fgr(FeatureRegistrar):
    """Fast global registration, by default with a final ICP.

    Lengths are in extents of the target; those of the final ICP, in spacings of the target.

    Args (those of FeatureRegistrar beside):
        max_distance: Distance at which the graduated optimisation ends.
        iterations: Iterations of the optimisation.
    """

    name = "fgr"
    # RPM-Net's published setting; it takes given normals, here estimated from 30 points within 0.1 (REFERENCES 5).
    presets: ClassVar = {
        "paper": {
            "normal_radius": 0.1,
            "feature_radius": 0.3,
            "feature_neighbours": 128,
            "orient_normals": False,
            "max_distance": 0.01,
            "flat": "features",
            "refine": "none",
        }
    }

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
        max_distance: float = 0.025,
        iterations: int = 64,
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
        self.max_distance = max_distance
        self.iterations = iterations
        self.flat = flat
        self.refine = refine
        self.refine_distance = refine_distance
        self.refine_iterations = refine_iterations

    def search(self, source: Any, target: Any, source_features: Any, target_features: Any) -> Any:
        """Search the motion; see FeatureRegistrar."""
        registration = import_open3d().pipelines.registration
        return registration.registration_fgr_based_on_feature_matching(
            source,
            target,
            source_features,
            target_features,
            registration.FastGlobalRegistrationOption(
                maximum_correspondence_distance=self.max_distance,
                iteration_number=self.iterations,
            ),
        )
