"""A random generator for compiled code: SplitMix64, whose whole state is one number."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)


def seeded_state(seed: int) -> NDArray[np.uint64]:
    """Return a state, (1,) uint64, for `below` to draw from and to change."""
    return np.array([seed % 2**64], dtype=np.uint64)


@njit(cache=True)
def below(state: NDArray[np.uint64], limit: int) -> int:
    """Draw a whole number in [0, limit) (Steele, Lea and Flood 2014)."""
    state[0] += _STEP
    bits = state[0]
    bits = (bits ^ (bits >> np.uint64(30))) * _FIRST
    bits = (bits ^ (bits >> np.uint64(27))) * _SECOND
    bits = bits ^ (bits >> np.uint64(31))
    # The upper 32 bits scaled down: the bias is under limit / 2^32.
    return int(np.int64(((bits >> np.uint64(32)) * np.uint64(limit)) >> np.uint64(32)))
