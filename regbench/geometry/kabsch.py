"""The rigid motion that best maps matched points onto each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.geometry.se3 import se3


def kabsch(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return the rigid motion that minimises the weighted squared distances of matched points.

    Kabsch (1976); the sign of the last singular vector keeps the answer a rotation where the best orthogonal matrix
    is a reflection (Umeyama 1991, Eq. 43). If the points do not determine the rotation (they are collinear, or all
    equal), one of the best rotations is returned.

    Args:
        source: (N, 3) points, N >= 1.
        target: (N, 3) points; row i matches row i of `source`.
        weights: (N,) weights that are not negative, or None for equal ones.

    Returns:
        T_target_source, (4, 4) float64.

    Raises:
        ValueError: The shapes do not match, there is no point, or the weights are negative or all zero.
    """
    source = np.asarray(source, dtype=np.float64)
    target = np.asarray(target, dtype=np.float64)
    if source.ndim != 2 or source.shape[1] != 3 or source.shape != target.shape or len(source) == 0:
        raise ValueError(f"kabsch needs two (N, 3) arrays of matched points, got {source.shape} and {target.shape}")
    if weights is None:
        share = np.full(len(source), 1.0 / len(source))
    else:
        share = np.asarray(weights, dtype=np.float64)
        if share.shape != (len(source),):
            raise ValueError(f"kabsch needs one weight per point, got {share.shape} for {len(source)} points")
        total = share.sum()
        if not (share >= 0).all() or not 0 < total < np.inf:
            raise ValueError("kabsch needs finite weights that are not negative and not all zero")
        share = share / total
    source_mean = share @ source
    target_mean = share @ target
    covariance = ((source - source_mean) * share[:, None]).T @ (target - target_mean)
    U, _, Vt = np.linalg.svd(covariance)
    if np.linalg.det(U) * np.linalg.det(Vt) < 0:
        Vt[2] = -Vt[2]
    rotation = (U @ Vt).T
    return se3(rotation, target_mean - rotation @ source_mean)
