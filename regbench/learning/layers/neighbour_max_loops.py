"""The two passes of the neighbour maximum as compiled loops. Imported when first used: numba costs a second."""

from __future__ import annotations

from typing import Any

import numba


@numba.njit(parallel=True, cache=True)
def forward(values: Any, neighbours: Any, maximum: Any, winners: Any) -> None:
    """Fill `maximum` (B, M, C) float32 and `winners` (B, M, C) int32 from values and neighbours."""
    clouds, rows, k = neighbours.shape
    channels = values.shape[2]
    for row in numba.prange(clouds * rows):
        b, i = row // rows, row % rows
        first = neighbours[b, i, 0]
        best, winner = maximum[b, i], winners[b, i]
        for c in range(channels):
            best[c] = values[b, first, c]
            winner[c] = first
        for n in range(1, k):
            j = neighbours[b, i, n]
            candidate = values[b, j]
            for c in range(channels):
                better = candidate[c] > best[c]
                best[c] = candidate[c] if better else best[c]  # without a branch: one vector instruction
                winner[c] = j if better else winner[c]


@numba.njit(parallel=True, cache=True)
def backward(gradient: Any, winners: Any, spread: Any) -> None:
    """Add each output's gradient to its winner's: `spread` (B, N, C) float32, zero before."""
    clouds, rows, channels = gradient.shape
    for b in numba.prange(clouds):
        for i in range(rows):
            for c in range(channels):
                spread[b, winners[b, i, c], c] += gradient[b, i, c]
