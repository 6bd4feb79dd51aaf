"""Translation errors: residuals per axis, and the isotropic length."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def translation_residuals(T_estimates: ArrayLike, T_truth: ArrayLike) -> Array:
    """Return predicted minus true translation per axis (DCP), of (..., 4, 4) motions; (..., 3), the clouds' unit."""
    residuals: Array = np.asarray(T_estimates, np.float64)[..., :3, 3] - np.asarray(T_truth, np.float64)[..., :3, 3]
    return residuals


def translation_error(T_estimates: ArrayLike, T_truth: ArrayLike) -> Array:
    """Return the norm of the translation part of T_truth^-1 T_estimate (RPM-Net), of (..., 4, 4) motions.

    T_truth's rotation does not change a length, so this is the norm of the difference of the two translations.

    Returns:
        (...) float64 in the clouds' unit.
    """
    error: Array = np.linalg.norm(translation_residuals(T_estimates, T_truth), axis=-1)
    return error
