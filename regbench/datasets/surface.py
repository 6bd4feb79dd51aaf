"""Points drawn uniformly by area on triangles, and the field's scaling to the unit sphere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def triangle_areas(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the areas of (F, 3, 3) triangles (F, corner, xyz), shape (F,)."""
    first = triangles[:, 1] - triangles[:, 0]
    second = triangles[:, 2] - triangles[:, 0]
    # Written out: np.cross is several times slower on many small vectors.
    x = first[:, 1] * second[:, 2] - first[:, 2] * second[:, 1]
    y = first[:, 2] * second[:, 0] - first[:, 0] * second[:, 2]
    z = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    areas: NDArray[np.float64] = 0.5 * np.sqrt(x * x + y * y + z * z)
    return areas


def sample_triangles(triangles: NDArray[np.float64], count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw `count` points uniformly by area on (F, 3, 3) triangles; (count, 3) float64, in random order.

    Raises:
        ValueError: The triangles have no area.
    """
    cumulative = np.cumsum(triangle_areas(triangles))
    if len(cumulative) == 0 or not cumulative[-1] > 0:
        raise ValueError("the surface has no area")
    # side="right": a triangle without area spans an empty interval and is never drawn.
    drawn = np.searchsorted(cumulative, rng.random(count) * cumulative[-1], side="right")
    corners = triangles[np.minimum(drawn, len(cumulative) - 1)]
    weights = rng.random((count, 2))
    # A point of the parallelogram's far half is mirrored into the triangle: uniform, without a square root.
    outside = weights.sum(axis=1) > 1
    weights[outside] = 1 - weights[outside]
    origin = corners[:, 0]
    points: NDArray[np.float64] = (
        origin + weights[:, :1] * (corners[:, 1] - origin) + weights[:, 1:] * (corners[:, 2] - origin)
    )
    return points


def to_unit_sphere(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centre (N, 3) points at their centroid and scale the farthest to distance 1, as ModelNet40's packs do.

    Raises:
        ValueError: All points are one.
    """
    centred = points - points.mean(axis=0)
    radius = np.sqrt((centred**2).sum(axis=1).max())
    if not radius > 0:
        raise ValueError("all points are one")
    scaled: NDArray[np.float64] = centred / radius
    return scaled
