"""Parts of CAD-like shapes as (F, 3, 3) float64 triangles (face, corner, xyz), and how parts are placed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.geometry.se3 import rotation_from_euler_deg

Triangles = NDArray[np.float64]


def box(x: float, y: float, z: float) -> Triangles:
    """Return a box of the given side lengths, centred at the origin."""
    return extrude([(-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2)], z)


def cylinder(radius: float, height: float, segments: int = 24) -> Triangles:
    """Return a cylinder along z with both caps, centred at the origin."""
    return cone(radius, radius, height, segments)


def cone(bottom_radius: float, top_radius: float, height: float, segments: int = 24) -> Triangles:
    """Return a cone or frustum along z with its caps, centred at the origin."""
    half = height / 2
    return revolve([(0, -half), (bottom_radius, -half), (top_radius, half), (0, half)], segments)


def sphere(radius: float, segments: int = 16) -> Triangles:
    """Return a sphere centred at the origin."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    return revolve(np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=1), segments)


def torus(ring_radius: float, tube_radius: float, arc_deg: float = 360.0, segments: int = 24) -> Triangles:
    """Return a torus about z, or its first `arc_deg` degrees from the x axis with open ends."""
    angles = np.linspace(0, 2 * np.pi, 11)
    profile = np.stack([ring_radius + tube_radius * np.cos(angles), tube_radius * np.sin(angles)], axis=1)
    return revolve(profile, segments, arc_deg)


def revolve(profile: ArrayLike, segments: int = 24, arc_deg: float = 360.0) -> Triangles:
    """Turn a (K, 2) profile of (radius, z) about z by `arc_deg`."""
    radius, z = np.asarray(profile, dtype=np.float64).T
    angles = np.linspace(0, np.radians(arc_deg), segments + 1)
    grid = np.empty((segments + 1, len(radius), 3))
    grid[..., 0] = np.cos(angles)[:, None] * radius
    grid[..., 1] = np.sin(angles)[:, None] * radius
    grid[..., 2] = z
    return _grid_triangles(grid)


def extrude(polygon: ArrayLike, height: float) -> Triangles:
    """Return the prism along z over a (K, 2) polygon that is star-shaped about its corners' mean, centred in z."""
    corners = np.asarray(polygon, dtype=np.float64)
    closed = np.vstack([corners, corners[:1]])
    middle = np.broadcast_to(corners.mean(axis=0), closed.shape)
    half = height / 2
    rings = [(middle, -half), (closed, -half), (closed, half), (middle, half)]
    grid = np.stack([np.column_stack([ring, np.full(len(ring), z)]) for ring, z in rings], axis=1)
    return _grid_triangles(grid)


def _grid_triangles(grid: NDArray[np.float64]) -> Triangles:
    """Return two triangles for each cell of an (A, B, 3) grid of points."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def place(part: Triangles, at: ArrayLike = (0, 0, 0), turn_deg: ArrayLike = (0, 0, 0)) -> Triangles:
    """Turn a part by angles about x, y, z (R = Rx Ry Rz), then move it."""
    moved: Triangles = part @ rotation_from_euler_deg(turn_deg).T + np.asarray(at, dtype=np.float64)
    return moved
