from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench.geometry.chamfer import chamfer_distance
from regbench.geometry.icp import icp
from regbench.geometry.se3 import se3, transform
from regbench.testing.clouds import body


@pytest.fixture
def pair():
    truth = se3(Rotation.from_rotvec([0.05, -0.1, 0.08]).as_matrix(), [0.05, 0.02, -0.03])
    source = body(400)
    return source, np.random.default_rng(0).permutation(transform(truth, source)), truth


def test_a_copy_is_found_exactly_and_the_matches_settle(pair):
    source, target, truth = pair
    result = icp(source, target, np.eye(4))
    np.testing.assert_allclose(result.T_target_source, truth, atol=1e-12)
    assert result.converged
    again = icp(source, target, result.T_target_source)
    np.testing.assert_allclose(again.T_target_source, result.T_target_source, atol=1e-14)


def test_every_iteration_lowers_the_squared_distance_to_the_nearest_points(pair):
    source, target, _ = pair
    tree = cKDTree(target)
    errors = [
        (tree.query(transform(icp(source, target, np.eye(4), max_iterations=n).T_target_source, source))[0] ** 2).sum()
        for n in range(6)
    ]
    assert all(after < before for before, after in pairwise(errors))


def test_iterations_are_counted_and_limited(pair):
    source, target, _ = pair
    result = icp(source, target, np.eye(4), max_iterations=1)
    assert (result.iterations, result.converged) == (1, False)
    assert np.array_equal(icp(source, target, np.eye(4), max_iterations=0).T_target_source, np.eye(4))


def test_chamfer_distance_by_brute_force():
    first, second = body(50), body(70, seed=1)
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    expected = distances.min(axis=1).mean() + distances.min(axis=0).mean()
    assert chamfer_distance(first, second) == pytest.approx(expected)
