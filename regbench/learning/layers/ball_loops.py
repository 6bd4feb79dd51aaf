"""The search in a ball as a compiled loop. Imported when first used: numba costs a second."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np


@numba.njit(parallel=True, cache=True)
def nearest_in_ball(points: Any, radius_squared: Any, chosen: Any) -> None:
    """Fill `chosen` (B, N, k) int64 with the k nearest of (B, N, 3) points in each point's ball, then with itself."""
    clouds, count, k = chosen.shape
    for row in numba.prange(clouds * count):
        b, i = row // count, row % count
        cloud, keep = points[b], chosen[b, i]
        x, y, z = cloud[i]
        kept = np.empty(k)
        found, worst, limit = 0, 0, radius_squared
        for j in range(count):
            distance = (cloud[j, 0] - x) ** 2 + (cloud[j, 1] - y) ** 2 + (cloud[j, 2] - z) ** 2
            # Only once k are found must another be nearer than the farthest of them.
            if distance > limit or (found == k and distance == limit):
                continue
            place = worst if found == k else found
            kept[place], keep[place] = distance, j
            if found < k:
                found += 1
            if found == k:
                worst, limit = 0, kept[0]
                for n in range(1, k):
                    if kept[n] > limit:
                        worst, limit = n, kept[n]
        keep[found:] = i
