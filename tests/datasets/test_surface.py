"""Area-uniform sampling against what must hold of it."""

import numpy as np
import pytest
from scipy import stats

from regbench.datasets.primitives import box, cylinder, extrude, place, revolve, sphere, torus
from regbench.datasets.surface import sample_surface, to_unit_sphere, triangle_areas


def mesh_of(triangles):
    """Return vertices and faces of (F, 3, 3) triangles."""
    return np.reshape(triangles, (-1, 3)), np.arange(3 * len(triangles)).reshape(-1, 3)


def test_points_fall_on_triangles_in_proportion_to_their_area():
    rng = np.random.default_rng(0)
    # Apart along x, so that a point tells its triangle; one has no area.
    triangles = rng.random((6, 3, 3)) + np.arange(6)[:, None, None] * [10, 0, 0]
    triangles[2, 2] = triangles[2, 1]
    points = sample_surface(*mesh_of(triangles), 20_000, rng)
    counts = np.bincount((points[:, 0] // 10).astype(int), minlength=6)
    areas = np.array([np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in triangles])
    np.testing.assert_allclose(triangle_areas(*mesh_of(triangles)), areas, atol=1e-15)
    assert counts[2] == 0
    used = np.delete(np.arange(6), 2)
    expected = areas[used] / areas.sum() * counts.sum()
    assert stats.chisquare(counts[used], expected).pvalue > 1e-3


def test_points_are_uniform_within_a_triangle_and_in_its_plane():
    triangle = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    points = sample_surface(*mesh_of(triangle), 20_000, np.random.default_rng(0))
    assert (points[:, 2] == 0).all()
    assert (points[:, :2] >= 0).all()
    assert (points[:, :2].sum(axis=1) <= 1 + 1e-12).all()
    # The part of the unit triangle with x + y < s has area s^2 of the whole.
    assert stats.kstest(points[:, :2].sum(axis=1) ** 2, "uniform").pvalue > 1e-3
    assert stats.kstest(1 - (1 - points[:, 0]) ** 2, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("triangles", [np.empty((0, 3, 3)), np.zeros((4, 3, 3))])
def test_no_area(triangles):
    with pytest.raises(ValueError, match="no area"):
        sample_surface(*mesh_of(triangles), 5, np.random.default_rng(0))


def test_to_unit_sphere():
    points = np.random.default_rng(0).normal(size=(100, 3)) * 40 + 1000
    scaled = to_unit_sphere(points)
    np.testing.assert_allclose(scaled.mean(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(scaled, axis=1).max() == pytest.approx(1)
    with pytest.raises(ValueError, match="all points are one"):
        to_unit_sphere(np.ones((5, 3)))


@pytest.mark.parametrize(
    ("part", "area"),
    [
        (box(1, 2, 3), 22),
        (cylinder(1, 2, 400), 6 * np.pi),
        (sphere(2, 400), 16 * np.pi),
        (torus(3, 1, segments=2000), 12 * np.pi**2),
        (torus(3, 1, 90, segments=500), 3 * np.pi**2),
        (revolve([(0, 0), (1, 0)], 1000), np.pi),
        (extrude([(0, 0), (1, 0), (0, 1)], 2), 1 + 2 * (2 + np.sqrt(2))),
        (place(box(1, 1, 1), (5, 6, 7), (10, 20, 30)), 6),
    ],
)
def test_areas_of_parts(part, area):
    # A torus's tube has ten sides, which loses 3 %.
    assert triangle_areas(*mesh_of(part)).sum() == pytest.approx(area, rel=0.04)
