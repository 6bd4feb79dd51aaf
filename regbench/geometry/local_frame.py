"""The frame that methods work in: each cloud about its own centroid, the target's extent as the unit of length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem
from regbench.geometry.se3 import se3
from regbench.geometry.size import extent

# Squares of larger lengths than this, and of the inverses of smaller ones, are not 64-bit numbers.
LARGEST = 1e150


@dataclass(frozen=True, eq=False)
class LocalFrame:
    """Two clouds about their centroids, in units of the target's extent.

    Lengths and tolerances of a method then mean the same on a chair of unit size and on a street in metres, and a
    rotation about the origin does not drag a far cloud away. The identity here is the motion that matches centroids.

    Attributes:
        source: (N, 3) float64.
        target: (M, 3) float64.
        source_centroid: (3,) float64 in the problem's units.
        target_centroid: (3,) float64 in the problem's units.
        unit: Length of one local unit in the problem's units.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    source_centroid: NDArray[np.float64]
    target_centroid: NDArray[np.float64]
    unit: float

    @classmethod
    def of(cls, problem: Problem) -> LocalFrame:
        """Make the frame of a problem.

        Raises:
            ValueError: A cloud has no points, or is too large or too small for 64-bit numbers.
        """
        for name, points in (("source", problem.source), ("target", problem.target)):
            if len(points) == 0:
                raise ValueError(f"the {name} cloud has no points")
            if np.abs(points).max() > LARGEST:
                raise ValueError(f"the {name} cloud has coordinates over {LARGEST:g}; scale both clouds down")
            if 0 < np.ptp(points, axis=0).max() < 1 / LARGEST:
                raise ValueError(f"the {name} cloud is smaller than {1 / LARGEST:g}; scale both clouds up")
        source_centroid = problem.source.mean(axis=0)
        target_centroid = problem.target.mean(axis=0)
        unit = extent(problem.target) or extent(problem.source) or 1.0
        return cls(
            (problem.source - source_centroid) / unit,
            (problem.target - target_centroid) / unit,
            source_centroid,
            target_centroid,
            unit,
        )

    def to_local(self, T_target_source: NDArray[np.float64]) -> NDArray[np.float64]:
        """Express a (4, 4) motion of the problem in the local frame."""
        rotation, translation = T_target_source[:3, :3], T_target_source[:3, 3]
        return se3(rotation, (rotation @ self.source_centroid + translation - self.target_centroid) / self.unit)

    def from_local(self, T_local: NDArray[np.float64]) -> NDArray[np.float64]:
        """Express a (4, 4) motion of the local frame in the problem's frames: T_target_source."""
        rotation, translation = T_local[:3, :3], T_local[:3, 3]
        return se3(rotation, self.target_centroid + self.unit * translation - rotation @ self.source_centroid)
