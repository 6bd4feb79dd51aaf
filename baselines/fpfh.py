"""Fast point feature histograms (Rusu et al. 2009) of a cloud, by open3d."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .open3d_library import import_open3d, point_cloud


def thinned(points: NDArray[np.float64], voxel: float) -> NDArray[np.float64]:
    """Return one point, the mean, for each voxel that holds any of (N, 3) points."""
    return np.array(point_cloud(points).voxel_down_sample(voxel).points)


def cloud_with_features(
    points: NDArray[np.float64],
    *,
    normal_radius: float,
    normal_neighbours: int,
    feature_radius: float,
    feature_neighbours: int,
    orient_normals: bool,
) -> tuple[Any, Any]:
    """Return an open3d cloud with normals, and its features.

    Args:
        points: (N, 3) float64, about the centroid of the cloud.
        normal_radius: Neighbourhood of a normal, in the points' unit.
        normal_neighbours: Most neighbours of a normal.
        feature_radius: Neighbourhood of a feature, in the points' unit.
        feature_neighbours: Most neighbours of a feature.
        orient_normals: Turn normals away from the centroid. An estimated normal's sign is arbitrary, so the same
            surface has different features in two poses; away from the centroid is the same side in both.
    """
    open3d = import_open3d()
    cloud = point_cloud(points)
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(normal_radius, normal_neighbours))
    if orient_normals:
        normals = np.asarray(cloud.normals)  # a view: turned in place
        normals[(normals * points).sum(axis=1) < 0] *= -1.0
    features = open3d.pipelines.registration.compute_fpfh_feature(
        cloud, open3d.geometry.KDTreeSearchParamHybrid(feature_radius, feature_neighbours)
    )
    return cloud, features
