"""The distance grid, against SciPy's distance transform and its nearest neighbours."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy import ndimage
from scipy.spatial import cKDTree

from regbench.geometry.distance_grid import DistanceGrid, voxel_of


def cloud(seed, count, dimensions=3):
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [1.0, 0.7, 0.4]
    points[:, dimensions:] = 0.25
    return points


def centres(grid):
    indices = np.stack(np.meshgrid(*(np.arange(n) for n in grid.shape), indexing="ij"), axis=-1).reshape(-1, 3)
    return grid.low + (indices + 0.5) * grid.cell


def voxels_of(grid, points):
    return np.clip(((points - grid.low) / grid.cell).astype(int), 0, grid.shape - 1)


@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.integers(0, 3), st.integers(2, 40))
@settings(deadline=None, max_examples=40)
def test_the_transform_is_scipys_between_voxels_that_hold_points(seed, count, dimensions, cells):
    """The labelled point lies in a voxel that is as near as any voxel with points."""
    points = cloud(seed, count, dimensions)
    grid = DistanceGrid.of(points, cells=cells)
    empty = np.ones(grid.shape, bool)
    empty[tuple(voxels_of(grid, points.astype(np.float32)).T)] = False
    expected = ndimage.distance_transform_edt(empty).reshape(-1)
    own = np.stack(np.unravel_index(np.arange(len(grid.labels)), grid.shape), axis=-1)
    found = np.linalg.norm(own - voxels_of(grid, grid.points[grid.labels]), axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.integers(0, 3))
@settings(deadline=None, max_examples=25)
def test_the_distance_is_that_to_the_labelled_point_and_never_under_the_nearest(seed, count, dimensions):
    points = cloud(seed, count, dimensions)
    grid = DistanceGrid.of(points, cells=20)
    places = centres(grid)
    to_label = np.linalg.norm(places - points[grid.labels], axis=1)
    np.testing.assert_allclose(grid.distances, to_label, atol=1e-5)
    nearest = cKDTree(points).query(places)[0]
    assert (grid.distances >= nearest - 1e-5).all()
    # Off by no more than two half diagonals of voxels.
    assert (grid.distances <= nearest + np.sqrt(3) * grid.cell + 1e-5).all()


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 50, 784, 5000]), st.integers(0, 3), st.integers(2, 40))
@settings(deadline=None, max_examples=30)
def test_the_exact_grid_has_the_nearest_points(seed, count, dimensions, cells):
    points = cloud(seed, count, dimensions)
    grid = DistanceGrid.of(points, cells=cells).exact()
    places = centres(grid)
    nearest = cKDTree(points).query(places)[0]
    np.testing.assert_allclose(grid.distances, nearest, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(places - points[grid.labels], axis=1), nearest, atol=1e-5)


def test_the_cloud_lies_inside_with_its_margin():
    points = cloud(0, 500)
    grid = DistanceGrid.of(points, cells=30, margin=0.2)
    longest = np.ptp(points, axis=0).max()
    assert (points.min(axis=0) - grid.low >= 0.2 * longest - 1e-6).all()
    assert (grid.low + grid.shape * grid.cell - points.max(axis=0) >= 0.2 * longest - 1e-6).all()
    assert grid.shape.max() == 30


@njit
def _voxel_of(x, y, z, low, per_cell, shape):
    return voxel_of(x, y, z, low, per_cell, shape)


def test_a_place_outside_has_the_nearest_voxel():
    grid = DistanceGrid.of(cloud(0, 100), cells=12)
    outside = grid.low.astype(float) - 5
    outside[1] = grid.low[1] + 2.5 * grid.cell
    assert _voxel_of(*outside, grid.low, 1 / grid.cell, grid.shape) == 2 * grid.shape[2]


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.array([[0, 0, np.nan]])])
def test_no_grid_of_nothing(points):
    with pytest.raises(ValueError, match="needs points"):
        DistanceGrid.of(points)


def test_equal_points_have_a_grid():
    grid = DistanceGrid.of(np.ones((5, 3)), cells=8)
    assert np.isfinite(grid.distances).all()
    assert grid.labels.min() >= 0
