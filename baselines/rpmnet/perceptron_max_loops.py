"""The maximum over groups of rows and its backward pass as compiled loops. Imported when first used."""

from __future__ import annotations

from typing import Any

import numba


@numba.njit(cache=True)
def group_max(values: Any, maximum: Any, winners: Any) -> None:
    """Fill `maximum` (P, C) float32 and `winners` (P, C) int32 from values (P, k, C): the first among equals."""
    points, k, channels = values.shape
    for i in range(points):
        best, winner, group = maximum[i], winners[i], values[i]
        for c in range(channels):
            best[c] = group[0, c]
            winner[c] = 0
        for n in range(1, k):
            for c in range(channels):
                better = group[n, c] > best[c]
                best[c] = group[n, c] if better else best[c]  # without a branch: one vector instruction
                winner[c] = n if better else winner[c]


@numba.njit(cache=True)
def relu_backward(gradient: Any, activated: Any) -> None:
    """Set the gradient of (R, F) activations that are zero to zero."""
    rows, width = gradient.shape
    for i in range(rows):
        for f in range(width):
            gradient[i, f] = gradient[i, f] if activated[i, f] > 0 else numba.float32(0)


@numba.njit(cache=True)
def group_max_backward(gradient: Any, winners: Any, weight: Any, hidden: Any, of_hidden: Any, of_weight: Any) -> None:
    """Fill `of_hidden` with what max over k of weight @ hidden, hidden = relu(...), gives the argument of relu.

    gradient and winners (P, C), weight and of_weight (C, F), to which is added; hidden and of_hidden (P k, F).
    """
    points, channels = gradient.shape
    width = weight.shape[1]
    k = len(hidden) // points
    of_hidden[:] = 0
    for i in range(points):
        for c in range(channels):
            g, row = gradient[i, c], i * k + winners[i, c]
            if g == 0:
                continue
            for f in range(width):
                of_hidden[row, f] += g * weight[c, f]
                of_weight[c, f] += g * hidden[row, f]
    relu_backward(of_hidden, hidden)
