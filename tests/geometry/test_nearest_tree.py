import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from regbench.geometry.nearest_tree import LEAF, build_tree, nearest_neighbours


@given(st.integers(1, 200), st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 2, 3]), st.booleans())
@settings(deadline=None, max_examples=60)
def test_the_nearest_point_is_that_of_all_pairs(count, seed, dimensions, rounded):
    """Also of points on a plane, on a line, all equal, and of many that are equally near."""
    rng = np.random.default_rng(seed)
    points, queries = rng.normal(size=(count, 3)), rng.normal(size=(40, 3)) * 2
    points[:, dimensions:] = 0.5
    if rounded:
        points, queries = points.round(), queries.round()
    found, squares = nearest_neighbours(*build_tree(points), queries)
    every = ((queries[:, None] - points[None]) ** 2).sum(axis=2)
    np.testing.assert_allclose(squares, every.min(axis=1), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(every[np.arange(40), found], squares, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("count", [LEAF, LEAF + 1, 784, 30_000])
def test_any_size_and_a_point_of_its_own_is_nearest(count):
    points = np.random.default_rng(0).normal(size=(count, 3))
    found, squares = nearest_neighbours(*build_tree(points), points[:2000])
    assert np.array_equal(found, np.arange(min(count, 2000)))
    assert not squares.any()


def test_the_tree_is_the_points_in_another_order():
    points = np.random.default_rng(0).normal(size=(500, 3))
    tree, order, _ = build_tree(points)
    assert np.array_equal(tree, points[order])
    assert sorted(order) == list(range(500))


def test_far_queries():
    points = np.random.default_rng(0).normal(size=(300, 3))
    queries = points[:50] * 1e6
    _, squares = nearest_neighbours(*build_tree(points), queries)
    np.testing.assert_allclose(np.sqrt(squares), cKDTree(points).query(queries)[0], rtol=1e-12)
