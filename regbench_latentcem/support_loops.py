"""The support function's loop on CPU, compiled: no product of points and directions is written to memory."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray


@njit(cache=True, parallel=True, fastmath={"contract", "nsz"})
def largest_products(clouds: NDArray[np.float32], axes: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Write the maximum over points x of n . x, for every cloud and direction.

    Args:
        clouds: (B, N, 3), N >= 1.
        axes: (3, D): x, y and z of the directions, each in one piece.
        out: (B, D).
    """
    for cloud in prange(clouds.shape[0]):
        for direction in range(axes.shape[1]):
            out[cloud, direction] = -np.inf
        for point in range(clouds.shape[1]):
            x, y, z = clouds[cloud, point, 0], clouds[cloud, point, 1], clouds[cloud, point, 2]
            for direction in range(axes.shape[1]):
                product = x * axes[0, direction] + y * axes[1, direction] + z * axes[2, direction]
                out[cloud, direction] = max(out[cloud, direction], product)
