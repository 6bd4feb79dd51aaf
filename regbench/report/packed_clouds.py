"""Clouds small enough for a page: thinned, and each coordinate in 16 bits."""

from __future__ import annotations

import base64
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

STEPS = 2**16 - 1


class PackedPair(TypedDict):
    """Two clouds in one box: base64 of little-endian uint16, x y z of each point; p = low + step * integer."""

    low: list[float]
    step: float
    source: str
    target: str


def pack_pair(source: ArrayLike, target: ArrayLike, max_points: int) -> PackedPair:
    """Pack (N, 3) and (M, 3) points, each cloud thinned to max_points, in one box's coordinates.

    A coordinate is off by at most half a step: 1 / 131,070 of the box's longest side.
    """
    clouds = [thinned(np.asarray(cloud, dtype=np.float64), max_points) for cloud in (source, target)]
    together = np.concatenate(clouds)
    low = together.min(axis=0)
    step = max(float((together.max(axis=0) - low).max()), 1e-12) / STEPS
    packed = [
        base64.b64encode(np.rint((cloud - low) / step).clip(0, STEPS).astype("<u2").tobytes()).decode()
        for cloud in clouds
    ]
    return PackedPair(low=low.tolist(), step=step, source=packed[0], target=packed[1])


def thinned(points: NDArray[np.float64], max_points: int) -> NDArray[np.float64]:
    """Return at most so many of (N, 3) points, drawn without replacement, the same ones every time."""
    if len(points) <= max_points:
        return points
    chosen = np.random.Generator(np.random.PCG64(0)).choice(len(points), max_points, replace=False)
    return points[np.sort(chosen)]
