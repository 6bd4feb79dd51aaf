"""Motions as they come from JSON, packed into one array of numbers, and checked all at once."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.se3 import RIGID_TOLERANCE, why_not_rigid

Array = NDArray[np.float64]
Positions = NDArray[np.int64]

# A rotation's entries are well within; so is any motion that a runner let pass. Beyond, products of entries overflow.
LARGEST_COSINE, LARGEST_TRANSLATION = 1.1, 1e100
BLOCK = 65536  # matrices looked at together: their products take memory


def append_motion(motions: array[float], T_target_source: Any) -> bool:
    """Add the 16 numbers of a 4x4 nested list, whatever they are; return False, and add nothing, where it is none.

    Raises:
        TypeError, OverflowError: An entry is no number, or a whole one beyond float64. `motions` is then spoilt.
    """
    match T_target_source:
        case [[_, _, _, _] as a, [_, _, _, _] as b, [_, _, _, _] as c, [_, _, _, _] as d]:
            for row in (a, b, c, d):
                motions.fromlist(row)
            return True
    return False


def unpacked(motions: array[float]) -> Array:
    """Return (n, 4, 4) float64 matrices of what `append_motion` added."""
    return np.frombuffer(motions, dtype=np.float64).reshape(-1, 4, 4)


def first_not_rigid(motions: Array) -> tuple[int, str] | None:
    """Return the position of the first of (n, 4, 4) matrices that is no rigid motion, and why; None if all are."""
    for start in range(0, len(motions), BLOCK):
        for position in start + _suspects(motions[start : start + BLOCK]):
            reason = why_not_rigid(T := motions[position])
            if reason is None and np.abs(T).max() >= LARGEST_TRANSLATION:
                reason = "longer than any"
            if reason is not None:
                return int(position), reason
    return None


def _suspects(motions: Array) -> Positions:
    """Return the positions of those that may not be rigid, for `why_not_rigid` to judge."""
    rigid = _within_limits(motions)
    within = motions[rigid]
    R = within[:, :3, :3]
    off = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max(axis=(1, 2), initial=0)
    last = np.abs(within[:, 3] - (0, 0, 0, 1)).max(axis=1, initial=0)
    rigid[rigid] = (np.maximum(off, last) < RIGID_TOLERANCE / 2) & (np.linalg.det(R) > 0)
    return np.flatnonzero(~rigid)


def _within_limits(motions: Array) -> NDArray[np.bool_]:
    rotations, translations = np.abs(motions[:, :, :3]), np.abs(motions[:, :, 3])
    # Comparisons with NaN are False.
    within = (rotations < LARGEST_COSINE).all(axis=(1, 2)) & (translations < LARGEST_TRANSLATION).all(axis=1)
    return np.asarray(within)
