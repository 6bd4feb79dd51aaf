"""KISS-ICP (Vizzo et al. 2023) of two clouds.

The package aligns scans to a growing map and has no call for a pair. A pair is its first two steps: a voxel hash map
of the target, and the source aligned to it by the package's registration.
"""

from __future__ import annotations

import numpy as np

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.starts import Start, skip_without_prior, start_of

from .local_frame import LocalFrame


class KissIcp(Registrar):
    """KISS-ICP's robust point-to-point ICP against a voxel hash map. Lengths are in extents of the target.

    Args:
        init: Where to start: "centroid", "identity" or "prior", as for `icp`.
        voxel: Edge of the map's voxels. A match is looked for in the 27 voxels around a point.
        max_points_per_voxel: Points that a voxel of the map keeps; it also keeps them apart, by the edge divided by
            this number's square root.
        downsampling: Edge of the voxels that keep one point of the source each; 0 keeps every point.
        max_correspondance_distance: Farthest match (spelt as the package does).
        kernel: Scale of the Geman-McClure kernel that weighs matches.
        max_iterations: Most iterations.
        tolerance: Stop when the update's norm (radians and extents together) is less.
    """

    name = "kiss_icp"
    requires = ("kiss_icp",)

    def __init__(
        self,
        *,
        init: Start = "centroid",
        voxel: float = 0.2,
        max_points_per_voxel: int = 100,
        downsampling: float = 0.02,
        max_correspondance_distance: float = 2.0,
        kernel: float = 0.03,
        max_iterations: int = 200,
        tolerance: float = 1e-6,
    ) -> None:
        self.init = init
        self.voxel = voxel
        self.max_points_per_voxel = max_points_per_voxel
        self.downsampling = downsampling
        self.max_correspondance_distance = max_correspondance_distance
        self.kernel = kernel
        self.max_iterations = max_iterations
        self.tolerance = tolerance

    def prepare(self) -> None:
        """Import kiss_icp."""
        import kiss_icp.mapping
        import kiss_icp.registration
        import kiss_icp.voxelization  # noqa: F401

    def skip(self, problem: Problem) -> str | None:
        """Decline problems without a motion prior if the start is taken from it."""
        return skip_without_prior(problem, self.init)

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud has no points; or there is no prior to start from.
        """
        from kiss_icp.mapping import VoxelHashMap
        from kiss_icp.registration import Registration as KissRegistration
        from kiss_icp.voxelization import voxel_down_sample

        frame = LocalFrame.of(problem)
        # No point of the target is farther than one extent from its centroid: none is dropped as far away.
        target_map = VoxelHashMap(self.voxel, max_distance=10.0, max_points_per_voxel=self.max_points_per_voxel)
        target_map.add_points(frame.target)
        T_local = KissRegistration(self.max_iterations, self.tolerance, problem.threads).align_points_to_map(
            points=voxel_down_sample(frame.source, self.downsampling) if self.downsampling else frame.source,
            voxel_map=target_map,
            initial_guess=start_of(problem, frame, self.init),
            max_correspondance_distance=self.max_correspondance_distance,
            kernel=self.kernel,
        )
        return Registration(T_target_source=frame.from_local(np.asarray(T_local)))
