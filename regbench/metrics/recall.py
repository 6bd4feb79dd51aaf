"""Recall: the share of pairs whose rotation and translation are both within a threshold."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# (degrees, length in the clouds' unit), by the name that metric keys carry.
THRESHOLDS = {"1deg": (1.0, 0.01), "5deg": (5.0, 0.05), "15deg": (15.0, 0.15)}


def within(
    rotation_errors_deg: ArrayLike, translation_errors: ArrayLike, max_rotation_deg: float, max_translation: float
) -> NDArray[np.bool_]:
    """Return which of n pairs have rotation error <= max_rotation_deg and translation error <= max_translation.

    Args:
        rotation_errors_deg: (n,) isotropic errors in degrees.
        translation_errors: (n,) isotropic errors in the clouds' unit.
        max_rotation_deg: Threshold in degrees, inclusive.
        max_translation: Threshold in the clouds' unit, inclusive.

    Returns:
        (n,) bool; their mean is the recall.
    """
    rotation = np.asarray(rotation_errors_deg, dtype=np.float64)
    translation = np.asarray(translation_errors, dtype=np.float64)
    if rotation.shape != translation.shape:
        raise ValueError(f"{rotation.shape} rotation errors but {translation.shape} translation errors")
    hits: NDArray[np.bool_] = (rotation <= max_rotation_deg) & (translation <= max_translation)
    return hits


def recall(
    rotation_errors_deg: ArrayLike, translation_errors: ArrayLike, max_rotation_deg: float, max_translation: float
) -> float:
    """Return the share of n pairs that are `within` the thresholds, in [0, 1]; NaN if there is no pair."""
    hits = within(rotation_errors_deg, translation_errors, max_rotation_deg, max_translation)
    return float(hits.mean()) if hits.size else float("nan")


def recall_curve(
    rotation_errors_deg: ArrayLike, translation_errors: ArrayLike, max_rotation_deg: ArrayLike, deg_per_length: float
) -> Array:
    """Return the recall at (k,) growing thresholds, the length threshold tied to the angle's.

    Args:
        rotation_errors_deg: (n,) isotropic errors in degrees.
        translation_errors: (n,) isotropic errors in the clouds' unit.
        max_rotation_deg: (k,) thresholds in degrees; the length threshold is the angle divided by deg_per_length.
        deg_per_length: 100 for the thresholds of regbench's tables: (1 deg, 0.01), (5 deg, 0.05), (15 deg, 0.15).

    Returns:
        (k,) float64 shares in [0, 1], not falling where the thresholds grow; NaN if there is no pair.
    """
    rotation = np.asarray(rotation_errors_deg, dtype=np.float64)
    length = np.asarray(translation_errors, dtype=np.float64)
    if rotation.shape != length.shape:
        raise ValueError(f"{rotation.shape} rotation errors but {length.shape} translation errors")
    thresholds = np.asarray(max_rotation_deg, dtype=np.float64)
    if not rotation.size:
        return np.full(thresholds.shape, np.nan)
    # A pair is a hit from the greater of its two errors on, both measured on the angle's scale.
    needed = np.sort(np.maximum(rotation, length * deg_per_length))
    shares: Array = np.searchsorted(needed, thresholds, side="right") / rotation.size
    return shares
