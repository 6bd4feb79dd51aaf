"""Points drawn uniformly by area on large meshes, in compiled loops.

This imports numba, and the first call compiles (later processes load what it kept): import it where it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from regbench.datasets.surface import checked_area


def _compiled(function: Callable[..., Any]) -> Any:
    """Compile on the first call, kept in __pycache__ or the user's cache folder; if neither is writable, not kept."""
    try:
        return numba.njit(function, cache=True)
    except RuntimeError:
        return numba.njit(function)


def sample_mesh(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return what `regbench.datasets.surface.sample_surface` returns, bit for bit, sooner.

    12 meshes of ModelNet40 took 2.5 ms, that one's 11.1 ms (benchmarks/bench_data.py): each face is visited once, and
    there are no temporary arrays. The other stays, for small shapes that are not worth importing numba.

    Args:
        vertices: (V, 3) float64.
        faces: (F, 3) indices into the vertices.
        count: Number of points.
        rng: Where the draws come from.

    Raises:
        ValueError: The surface has no area, or more than a float64 can hold.
        IndexError: A face names a vertex that is not there.
    """
    sums = _cumulative_areas(vertices, faces)
    picks = rng.random(count) * checked_area(sums)
    points: NDArray[np.float64] = _points_on_faces(vertices, faces, sums, picks, rng.random((count, 2)))
    return points


@_compiled
def _cumulative_areas(vertices, faces):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    sums = np.empty(len(faces))
    total = 0.0
    vertex_count = np.uint64(len(vertices))
    for face in range(len(faces)):
        # Unsigned, a negative index is a large one. Compiled code would read whatever lies there.
        a, b, c = np.uint64(faces[face, 0]), np.uint64(faces[face, 1]), np.uint64(faces[face, 2])
        if a >= vertex_count or b >= vertex_count or c >= vertex_count:
            raise IndexError("a face names a vertex that is not there")
        x, y, z = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        ux, uy, uz = vertices[b, 0] - x, vertices[b, 1] - y, vertices[b, 2] - z
        vx, vy, vz = vertices[c, 0] - x, vertices[c, 1] - y, vertices[c, 2] - z
        cx, cy, cz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        total += 0.5 * np.sqrt(cx * cx + cy * cy + cz * cz)
        sums[face] = total
    return sums


@_compiled
def _points_on_faces(vertices, faces, sums, picks, weights):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    points = np.empty((len(picks), 3))
    for i in range(len(picks)):
        face = min(np.searchsorted(sums, picks[i], side="right"), len(sums) - 1)
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        u, v = weights[i, 0], weights[i, 1]
        if u + v > 1:
            u, v = 1 - u, 1 - v
        for axis in range(3):
            origin = vertices[a, axis]
            points[i, axis] = origin + (vertices[b, axis] - origin) * u + (vertices[c, axis] - origin) * v
    return points
