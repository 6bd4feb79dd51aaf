"""What a step of every ICP is made of, compiled: move a point, gather matches, fit a motion to them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.horn import rotation_of_covariance

Points = NDArray[np.floating[Any]]


@njit(cache=True)
def moved_point(
    rotation: NDArray[np.float64], translation: NDArray[np.float64], points: Points, index: int
) -> tuple[float, float, float]:
    """Return a point after a motion.

    Args:
        rotation: (3, 3).
        translation: (3,).
        points: (N, 3).
        index: Which of them.
    """
    a, b, c = points[index, 0], points[index, 1], points[index, 2]
    return (
        rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c + translation[0],
        rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c + translation[1],
        rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c + translation[2],
    )


@njit(cache=True)
def add_match(
    sums: NDArray[np.float64],
    products: NDArray[np.float64],
    source: Points,
    index: int,
    target: Points,
    match: int,
) -> None:
    """Gather one match.

    Points are taken relative to the first of their cloud, so that nothing is lost where a cloud is far from the origin.

    Args:
        sums: (2, 3) float64, of source and target points; changed.
        products: (3, 3) float64, sums of source times target; changed.
        source: (N, 3).
        index: The point.
        target: (M, 3).
        match: Its match.
    """
    a, b, c = source[index, 0] - source[0, 0], source[index, 1] - source[0, 1], source[index, 2] - source[0, 2]
    u, v, w = target[match, 0] - target[0, 0], target[match, 1] - target[0, 1], target[match, 2] - target[0, 2]
    sums[0, 0] += a
    sums[0, 1] += b
    sums[0, 2] += c
    sums[1, 0] += u
    sums[1, 1] += v
    sums[1, 2] += w
    products[0, 0] += a * u
    products[0, 1] += a * v
    products[0, 2] += a * w
    products[1, 0] += b * u
    products[1, 1] += b * v
    products[1, 2] += b * w
    products[2, 0] += c * u
    products[2, 1] += c * v
    products[2, 2] += c * w


@njit(cache=True)
def fit_matches(
    sums: NDArray[np.float64],
    products: NDArray[np.float64],
    matched: int,
    source: Points,
    target: Points,
    rotation: NDArray[np.float64],
    translation: NDArray[np.float64],
) -> None:
    """Write the motion of least squares over the matches gathered.

    Args:
        sums: Of `add_match`.
        products: Likewise; afterwards it is the covariance.
        matched: How many, at least one.
        source: (N, 3).
        target: (M, 3).
        rotation: (3, 3) float64, written.
        translation: (3,) float64, written.
    """
    for row in range(3):
        for column in range(3):
            products[row, column] -= sums[0, row] * sums[1, column] / matched
    rotation_of_covariance(products, rotation)
    for row in range(3):
        translation[row] = sums[1, row] / matched + target[0, row]
        for column in range(3):
            translation[row] -= rotation[row, column] * (sums[0, column] / matched + source[0, column])
