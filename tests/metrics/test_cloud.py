"""Metrics over clouds against brute force, and what a symmetry must not change."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regbench.geometry.se3 import invert, se3, transform
from regbench.metrics.cloud import modified_chamfer, symmetry_aware_error


def motion(rng):
    return se3(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3))


def nearest_distances(points, cloud):
    return np.sqrt(((points[:, None] - cloud[None]) ** 2).sum(axis=2)).min(axis=1)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_symmetry_aware_error_is_brute_force_s(seed):
    rng = np.random.default_rng(seed)
    source, truth, estimates = rng.normal(size=(40, 3)), motion(rng), [motion(rng) for _ in range(3)]
    expected = [nearest_distances(transform(T, source), transform(truth, source)).mean() for T in estimates]
    np.testing.assert_allclose(symmetry_aware_error(estimates, truth, source), expected, rtol=1e-9)


def test_symmetry_aware_error_forgives_a_symmetry_and_nothing_else():
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    truth = se3(Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix(), [0.1, 0.2, 0.3])
    quarter, eighth = (se3(Rotation.from_euler("z", a, degrees=True).as_matrix(), [0, 0, 0]) for a in (90, 45))
    errors = symmetry_aware_error([truth, truth @ quarter, truth @ eighth], truth, cube)
    np.testing.assert_allclose(errors[:2], 0, atol=1e-12)
    assert errors[2] > 0.5


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_modified_chamfer_is_brute_force_s(seed):
    rng = np.random.default_rng(seed)
    source, target, clean = rng.normal(size=(30, 3)), rng.normal(size=(25, 3)), rng.normal(size=(60, 3))
    truth, T = motion(rng), motion(rng)
    clean_target = transform(truth, clean)
    expected = (nearest_distances(transform(T, source), clean_target) ** 2).mean() + (
        nearest_distances(target, transform(T, clean)) ** 2
    ).mean()
    np.testing.assert_allclose(modified_chamfer([T], source, target, clean, clean_target), [expected], rtol=1e-9)


def test_modified_chamfer_of_the_truth_is_the_noise_alone():
    rng = np.random.default_rng(1)
    clean, truth = rng.normal(size=(200, 3)), motion(rng)
    noise = rng.normal(scale=1e-4, size=(2, 200, 3))
    source, target = clean + noise[0], transform(truth, clean) + noise[1]
    value = modified_chamfer([truth], source, target, clean, transform(truth, clean))[0]
    assert value == pytest.approx((noise[0] ** 2).sum(1).mean() + (noise[1] ** 2).sum(1).mean(), rel=1e-6)


def test_modified_chamfer_is_the_same_for_the_inverse_problem():
    rng = np.random.default_rng(2)
    source, target, clean = rng.normal(size=(3, 50, 3))
    truth, T = motion(rng), motion(rng)
    clean_target = transform(truth, clean)
    forward = modified_chamfer([T], source, target, clean, clean_target)
    backward = modified_chamfer([invert(T)], target, source, clean_target, clean)
    np.testing.assert_allclose(forward, backward, rtol=1e-9)


@pytest.mark.parametrize("bad", [np.empty((0, 3)), np.zeros((4, 2)), np.zeros(3)])
def test_clouds_of_the_wrong_shape_are_named(bad):
    with pytest.raises(ValueError, match=r"source must have shape \(N, 3\) with N >= 1, got"):
        symmetry_aware_error([np.eye(4)], np.eye(4), bad)
    good = np.zeros((4, 3))
    with pytest.raises(ValueError, match=r"clean_target must have shape \(N, 3\) with N >= 1, got"):
        modified_chamfer([np.eye(4)], good, good, good, bad)
