"""Area-uniform points on the surface of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.surface import sample_triangles


def sample_mesh(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Draw `count` points uniformly by area on a mesh; (count, 3) float64, in random order.

    Args:
        vertices: (V, 3) float64.
        faces: (F, 3) indices into the vertices.
        count: Number of points.
        rng: Where the draws come from.

    Raises:
        ValueError: The mesh has no faces, or none with an area.
    """
    if len(faces) == 0:
        raise ValueError("the mesh has no faces")
    return sample_triangles(vertices[faces], count, rng)
