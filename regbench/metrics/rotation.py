"""Rotation errors: the isotropic angle, and the residuals of Euler angles that the DCP family of papers prints."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.geometry.se3 import euler_deg_from_rotation

Array = NDArray[np.float64]


def nearest_rotation(rotations: ArrayLike) -> Array:
    """Return the rotations nearest to (..., 3, 3) almost orthonormal matrices (polar factor), (..., 3, 3) float64.

    Two Newton-Schulz steps: a matrix off by e comes out off by about e**4. From the 1e-4 that the contract accepts
    that is below float64's rounding, and no singular value decomposition is needed.
    """
    R = np.asarray(rotations, dtype=np.float64)
    for _ in range(2):
        R = 1.5 * R - 0.5 * R @ (np.swapaxes(R, -1, -2) @ R)
    return R


def rotation_error_deg(R_estimates: ArrayLike, R_truth: ArrayLike) -> Array:
    """Return the angle of R_truth^-1 R_estimate: the norm of its rotation vector.

    The angle is taken from its sine and its cosine together. Each is right to rounding, so the angle is right to
    about 1e-14 deg everywhere; the arc cosine of the trace alone reads 0 below 1e-6 deg.

    Args:
        R_estimates: (..., 3, 3), orthonormal to 1e-4 or better.
        R_truth: (..., 3, 3), likewise.

    Returns:
        (...) float64 degrees in [0, 180].
    """
    D = np.swapaxes(nearest_rotation(R_truth), -1, -2) @ nearest_rotation(R_estimates)
    axis = np.stack([D[..., 2, 1] - D[..., 1, 2], D[..., 0, 2] - D[..., 2, 0], D[..., 1, 0] - D[..., 0, 1]], axis=-1)
    sine = np.linalg.norm(axis, axis=-1) / 2
    cosine = (np.trace(D, axis1=-2, axis2=-1) - 1) / 2
    angle: Array = np.degrees(np.arctan2(sine, cosine))
    return angle


def euler_residuals_deg(R_estimates: ArrayLike, R_truth: ArrayLike) -> Array:
    """Return predicted minus true Euler angles about x, y, z, with R = Rx Ry Rz on column vectors.

    DCP's residual: both sides go through the same extraction, and a difference is not wrapped to (-180, 180].

    Args:
        R_estimates: (..., 3, 3), orthonormal to 1e-4 or better.
        R_truth: (..., 3, 3), likewise.

    Returns:
        (..., 3) float64 degrees.
    """
    estimated = euler_deg_from_rotation(nearest_rotation(R_estimates))
    return estimated - euler_deg_from_rotation(nearest_rotation(R_truth))


def rmse(residuals: ArrayLike) -> float:
    """Return the root of the mean square over all pairs and axes together, of (n, 3) residuals; NaN if empty."""
    values = np.asarray(residuals, dtype=np.float64)
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def mae(residuals: ArrayLike) -> float:
    """Return the mean absolute value over all pairs and axes together, of (n, 3) residuals; NaN if empty."""
    values = np.asarray(residuals, dtype=np.float64)
    return float(np.mean(np.abs(values))) if values.size else float("nan")


def rmse_to_mae_bound(n: int) -> float:
    """Return sqrt(3 n): RMSE / MAE over n pairs and three axes cannot be greater, whatever the residuals."""
    return float(np.sqrt(3 * n))
