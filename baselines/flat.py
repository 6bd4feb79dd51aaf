"""Flat clouds: all points in one plane, where surface features say nothing."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.se3 import se3

FLATNESS = 1e-3


def is_flat(points: NDArray[np.float64]) -> bool:
    """Return whether (N, 3) points about their centroid lie in a plane, to a thousandth of their width."""
    widths = np.linalg.svd(points, compute_uv=False)
    return bool(widths[-1] < FLATNESS * widths[0])


def principal_starts(source: NDArray[np.float64], target: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the four (4, 4) motions that turn the source's principal axes onto the target's.

    Args:
        source: (N, 3) float64, about its centroid.
        target: (M, 3) float64, about its centroid.
    """
    axes_source, axes_target = (np.linalg.svd(points, full_matrices=False)[2].T for points in (source, target))
    starts = []
    for first, second in product((1.0, -1.0), repeat=2):
        third = first * second * np.linalg.det(axes_source) * np.linalg.det(axes_target)
        starts.append(se3(axes_target @ np.diag([first, second, third]) @ axes_source.T, np.zeros(3)))
    return starts
