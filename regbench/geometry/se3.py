"""Rigid motions as (4, 4) matrices, and the one Euler convention of the field's papers.

Angles are (x, y, z) in degrees with R = Rx Ry Rz on column vectors: SciPy's lower-case (extrinsic) 'zyx' on the
triple (z, y, x), as in DCP's code.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Matrix = NDArray[np.float64]

# Float32 networks answer rotations that are orthonormal to about 1e-6; a reflection or a scale is off by far more.
RIGID_TOLERANCE = 1e-4


def se3(rotation: ArrayLike, translation: ArrayLike) -> Matrix:
    """Return the (4, 4) float64 motion of a (3, 3) rotation and a (3,) translation."""
    T = np.eye(4)
    T[:3, :3] = rotation
    T[:3, 3] = translation
    return T


def invert(T: ArrayLike) -> Matrix:
    """Return the inverse of a (4, 4) rigid motion, exactly as a rigid motion (rotation transposed)."""
    matrix = np.asarray(T, dtype=np.float64)
    rotation = matrix[:3, :3].T
    return se3(rotation, -rotation @ matrix[:3, 3])


def transform(T: ArrayLike, points: ArrayLike) -> NDArray[np.float64]:
    """Move (N, 3) points by a (4, 4) rigid motion."""
    matrix = np.asarray(T, dtype=np.float64)
    moved: NDArray[np.float64] = np.asarray(points, dtype=np.float64) @ matrix[:3, :3].T
    moved += matrix[:3, 3]
    return moved


def why_not_rigid(T: object, tolerance: float = RIGID_TOLERANCE) -> str | None:
    """Say in words why a value is not a (4, 4) rigid motion, or return None if it is one."""
    try:
        matrix = np.asarray(T)
    except (TypeError, ValueError, RuntimeError):  # RuntimeError: a torch tensor that requires a gradient
        return f"not a matrix of numbers: {type(T).__name__}"
    if matrix.dtype.kind not in "fiu":
        return f"not a matrix of numbers: {type(T).__name__} ({matrix.dtype})"
    if matrix.shape != (4, 4):
        return f"shape {matrix.shape}, expected (4, 4)"
    # Plain floats from here: 4 us where NumPy took 13 on these 16 numbers, and this is part of every trial.
    (a, b, c, _), (d, e, f, _), (g, h, i, _), last = rows = matrix.astype(np.float64).tolist()
    if not all(math.isfinite(value) for row in rows for value in row):
        return "has values that are not finite"
    if max(abs(value - expected) for value, expected in zip(last, (0, 0, 0, 1), strict=True)) > tolerance:
        return "its last row is not 0 0 0 1"
    lengths = (a * a + b * b + c * c - 1, d * d + e * e + f * f - 1, g * g + h * h + i * i - 1)
    angles = (a * d + b * e + c * f, d * g + e * h + f * i, g * a + h * b + i * c)
    error = max(abs(value) for value in lengths + angles)
    if not error <= tolerance:
        return f"its rotation is not orthonormal (off by {error:.2g})"
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0:
        return "its rotation is a reflection"
    return None


def nearest_rigid(T: ArrayLike) -> Matrix:
    """Return the (4, 4) motion whose rotation is the nearest to that of T: for matrices printed with few digits."""
    matrix = np.asarray(T, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix[:3, :3])
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return se3(left @ flip @ right, matrix[:3, 3])


def rotation_from_euler_deg(angles_deg: ArrayLike) -> Matrix:
    """Return R = Rx Ry Rz, (3, 3) float64, for angles (x, y, z) in degrees."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(radians := np.radians(angles_deg)), np.sin(radians)
    return np.array(
        [
            [cy * cz, -cy * sz, sy],
            [cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy],
            [sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy],
        ]
    )


def euler_deg_from_rotation(rotations: ArrayLike) -> NDArray[np.float64]:
    """Return angles (x, y, z) in degrees with R = Rx Ry Rz, for (..., 3, 3) rotations; shape (..., 3).

    y lies in [-90, 90], x and z in [-180, 180]. At y = +-90 deg only x + z or x - z is defined; x is then 0, as in
    SciPy. z is read off Rx^T R = Ry Rz, so that the angles give the rotation back also near that lock.
    """
    R = np.asarray(rotations, dtype=np.float64)
    locked = np.hypot(R[..., 0, 0], R[..., 0, 1]) < 1e-12
    x = np.where(locked, 0.0, np.arctan2(-R[..., 1, 2], R[..., 2, 2]))
    y = np.arctan2(R[..., 0, 2], np.hypot(R[..., 0, 0], R[..., 0, 1]))
    cx, sx = np.cos(x), np.sin(x)
    z = np.arctan2(cx * R[..., 1, 0] + sx * R[..., 2, 0], cx * R[..., 1, 1] + sx * R[..., 2, 1])
    angles: NDArray[np.float64] = np.degrees(np.stack([x, y, z], axis=-1))
    return angles
