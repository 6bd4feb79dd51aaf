from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench.geometry.chamfer import chamfer_distance
from regbench.geometry.icp import icp
from regbench.geometry.kabsch import kabsch
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


def plain_icp(source, target, T, iterations):
    """ICP as the paper has it: SciPy's tree, and `kabsch`."""
    tree = cKDTree(target)
    for _ in range(iterations):
        T = kabsch(source, target[tree.query(transform(T, source))[1]])
    return T


@pytest.mark.parametrize("iterations", [1, 4, 30])
def test_each_iteration_is_that_of_a_plain_icp(pair, iterations):
    source, target, _ = pair
    noisy = target + np.random.default_rng(1).normal(0, 0.02, target.shape)
    found = icp(source, noisy, np.eye(4), max_iterations=iterations).T_target_source
    np.testing.assert_allclose(found, plain_icp(source, noisy, np.eye(4), iterations), atol=1e-12)


def test_trimmed_icp_does_not_mind_what_has_no_partner(pair):
    source, target, truth = pair
    cut = target[np.argsort(target[:, 0])[: int(0.7 * len(target))]]
    trimmed = icp(source, cut, np.eye(4), overlap=0.65)
    np.testing.assert_allclose(trimmed.T_target_source, truth, atol=1e-9)
    assert trimmed.matched == pytest.approx(0.65, abs=0.01)
    assert trimmed.residual < 1e-9
    assert np.abs(icp(source, cut, np.eye(4)).T_target_source - truth).max() > 0.01


def test_far_pairs_are_left_out(pair):
    source, target, truth = pair
    outliers = np.concatenate([target, np.full((50, 3), 9.0)])
    with_far = np.concatenate([source, np.full((20, 3), -9.0)])
    result = icp(with_far, outliers, truth, max_distance=0.1)
    np.testing.assert_allclose(result.T_target_source, truth, atol=1e-12)
    assert result.matched == pytest.approx(len(source) / len(with_far))
    alone = icp(with_far, target, se3(np.eye(3), [50.0, 0, 0]), max_distance=0.1)
    assert (alone.iterations, alone.converged) == (0, False)


def test_a_tolerance_stops_earlier(pair):
    source, target, _ = pair
    noisy = target + np.random.default_rng(1).normal(0, 0.02, target.shape)
    whole, early = (icp(source, noisy, np.eye(4), tolerance=tolerance) for tolerance in (0.0, 1e-2))
    assert early.converged
    assert early.iterations < whole.iterations
    assert early.residual == pytest.approx(whole.residual, rel=0.1)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.array([[0.0, np.nan, 1.0]])])
def test_clouds_that_cannot_be_aligned_are_refused(points):
    for source, target in ((points, body(10)), (body(10), points)):
        with pytest.raises(ValueError, match="points in both clouds"):
            icp(source, target, np.eye(4))
    with pytest.raises(ValueError, match="overlap"):
        icp(body(10), body(10), np.eye(4), overlap=0.0)


def test_chamfer_distance_by_brute_force():
    first, second = body(50), body(70, seed=1)
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    expected = distances.min(axis=1).mean() + distances.min(axis=0).mean()
    assert chamfer_distance(first, second) == pytest.approx(expected)
