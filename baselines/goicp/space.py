"""What Go-ICP searches, in numbers that compiled code can read.

All lengths are in voxels of the target's grid, whose low corner is the origin.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Space(NamedTuple):
    """What is searched: clouds, grid, and the ranges of the motion.

    Attributes:
        points: (3, N) float32, the source about the origin.
        reach: (N,) float32, distance of each point from the origin.
        target: (M, 3) float32.
        labels: (V,) int32 of the target's grid, an exact one where bounds are wanted.
        distances: (V,) float32 of it.
        shape: (3,) of it.
        tree: (M, 3) float64, the target as a k-d tree (regbench.geometry.nearest_tree).
        axes: (M,) int8 of it.
        places: (M,) int64, where in the tree each point is.
        kept: Points of the source that count.
        euler: Whether rotations are Euler angles rather than angle times axis.
        rotation_centre: (3,) float64, middle of the range of rotations.
        rotation_half: (3,) float64, its half edges.
        centre: (3,) float32, middle of the range of translations.
        half: (3,) float64, its half edges.
    """

    points: NDArray[np.float32]
    reach: NDArray[np.float32]
    target: NDArray[np.float32]
    labels: NDArray[np.int32]
    distances: NDArray[np.float32]
    shape: NDArray[np.int64]
    tree: NDArray[np.float64]
    axes: NDArray[np.int8]
    places: NDArray[np.int64]
    kept: int
    euler: bool
    rotation_centre: NDArray[np.float64]
    rotation_half: NDArray[np.float64]
    centre: NDArray[np.float32]
    half: NDArray[np.float64]


class Heap(NamedTuple):
    """Cells that wait, the least bound on top: `bounds` (C,) float64, `cells` (C, 4) float32."""

    bounds: NDArray[np.float64]
    cells: NDArray[np.float32]


def empty_heap(capacity: int) -> Heap:
    """Return a heap without cells."""
    return Heap(np.empty(capacity), np.empty((capacity, 4), np.float32))
