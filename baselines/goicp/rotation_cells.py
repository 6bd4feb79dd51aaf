"""Boxes of rotations: cubes in the ball of angle times axis, or boxes of Euler angles."""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def rotation_at(x: float, y: float, z: float, euler: bool, rotation: NDArray[np.float32]) -> None:
    """Write the rotation of three parameters.

    Args:
        x: Of angle times axis in radians; or the angle about x in radians, for R = Rx Ry Rz.
        y: Likewise.
        z: Likewise.
        euler: Which of the two.
        rotation: (3, 3) float32, written.
    """
    if euler:
        ca, cb, cc = cos(x), cos(y), cos(z)
        sa, sb, sc = sin(x), sin(y), sin(z)
        rotation[0, 0], rotation[0, 1], rotation[0, 2] = cb * cc, -cb * sc, sb
        rotation[1, 0], rotation[1, 1], rotation[1, 2] = ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb
        rotation[2, 0], rotation[2, 1], rotation[2, 2] = sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb
        return
    angle = sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        for row in range(3):
            for column in range(3):
                rotation[row, column] = 1.0 if row == column else 0.0
        return
    a, b, c = x / angle, y / angle, z / angle
    s, k = sin(angle), cos(angle)
    v = 1.0 - k
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = k + a * a * v, a * b * v - c * s, a * c * v + b * s
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = a * b * v + c * s, k + b * b * v, b * c * v - a * s
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = a * c * v - b * s, b * c * v + a * s, k + c * c * v


@njit(cache=True)
def cell_angle(half: NDArray[np.float64], scale: float, euler: bool) -> float:
    """Return a bound in radians on the angle between a cell's centre and any rotation in it.

    Angle times axis: the distance to a corner (Go-ICP, Lemma 1). Euler angles: each step turns by its own angle, so
    their sum (triangle inequality of angles).

    Args:
        half: (3,) half edges of the whole range.
        scale: Half edges of the cell, as a share of those.
        euler: Which parameters.
    """
    if euler:
        return min(pi, scale * float(half[0] + half[1] + half[2]))
    return min(pi, scale * sqrt(float(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)))


@njit(cache=True)
def is_repeated(corner: int, half: NDArray[np.float64]) -> bool:
    """Return whether a cell's eighth is the same as one before, since the range has no width along an axis.

    Args:
        corner: Number of the eighth; bit k says on which side along axis k it is.
        half: (3,) half edges of the whole range.
    """
    repeated = False
    for axis in range(3):
        repeated |= half[axis] == 0.0 and corner >> axis & 1 == 1
    return repeated


@njit(cache=True)
def is_outside_ball(x: float, y: float, z: float, half: NDArray[np.float64], scale: float, euler: bool) -> bool:
    """Return whether a cell holds no angle times axis of at most pi: other cells hold its rotations."""
    if euler:
        return False
    # The cell's point that is nearest to the origin.
    a = max(abs(x) - scale * half[0], 0.0)
    b = max(abs(y) - scale * half[1], 0.0)
    c = max(abs(z) - scale * half[2], 0.0)
    return bool(a * a + b * b + c * c > pi * pi)
