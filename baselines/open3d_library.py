"""The one door to open3d: its import, its point clouds, and its ICP as the last step of a method."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.size import spacing
from regbench.native import load_libusb


def import_open3d() -> Any:
    """Import open3d, after the shared library that its wheel expects of the system.

    Called inside functions: the import takes seconds, and `regbench ls` reads the modules of all methods.
    """
    load_libusb()
    import open3d

    return open3d


def point_cloud(points: NDArray[np.float64]) -> Any:
    """Return an open3d point cloud that holds a copy of (N, 3) float64 points."""
    open3d = import_open3d()
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))


def seed_open3d(seed: int) -> None:
    """Seed open3d's one global generator; called at the start of every answer that draws from it."""
    import_open3d().utility.random.seed(seed)


def point_to_point_icp(
    source: Any, target: Any, start: NDArray[np.float64], *, max_distance: float, max_iterations: int, tolerance: float
) -> Any:
    """Align two open3d clouds by point-to-point ICP from a (4, 4) start; return open3d's RegistrationResult."""
    registration = import_open3d().pipelines.registration
    return registration.registration_icp(
        source,
        target,
        max_distance,
        start,
        registration.TransformationEstimationPointToPoint(),
        registration.ICPConvergenceCriteria(tolerance, tolerance, max_iterations),
    )


def final_icp(source: Any, target: Any, result: Any, *, max_spacings: float, max_iterations: int) -> Any:
    """Improve a global method's RegistrationResult by point-to-point ICP, and return the new one.

    Args:
        source: open3d cloud.
        target: open3d cloud of at least two points.
        result: What the global method answered.
        max_spacings: Farthest match, in spacings of the target.
        max_iterations: Most iterations.
    """
    max_distance = max_spacings * spacing(np.asarray(target.points))
    if max_distance == 0:  # every point of the target is there twice: no length to match within
        return result
    return point_to_point_icp(
        source,
        target,
        result.transformation,
        max_distance=max_distance,
        max_iterations=max_iterations,
        tolerance=1e-8,
    )
