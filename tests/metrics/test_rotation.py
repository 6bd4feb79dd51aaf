"""Rotation metrics against SciPy, exact constructions and what must hold of any residuals."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regbench.metrics.rotation import (
    euler_residuals_deg,
    mae,
    nearest_rotation,
    rmse,
    rmse_to_mae_bound,
    rotation_error_deg,
)

SEEDS = st.integers(0, 2**32 - 1)


def exact_rotation(w, x, y, z):
    """The rotation of an integer quaternion, each entry an exact fraction rounded once, and its angle in degrees."""
    n = w * w + x * x + y * y + z * z
    entries = [
        [n - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), n - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), n - 2 * (x * x + y * y)],
    ]
    R = np.array([[float(Fraction(entry, n)) for entry in row] for row in entries])
    return R, math.degrees(2 * math.atan2(math.sqrt(x * x + y * y + z * z), abs(w)))


@pytest.mark.parametrize("scale", [1, 10**3, 10**6, 10**9, 10**12, 10**15])
def test_angle_is_right_near_0(scale):
    R, angle_deg = exact_rotation(scale, 1, -2, 2)
    assert rotation_error_deg(R, np.eye(3)) == pytest.approx(angle_deg, abs=1e-12)
    assert rotation_error_deg(R, np.eye(3)) > 0


@pytest.mark.parametrize("scale", [1, 10**3, 10**6, 10**9, 10**12])
def test_angle_is_right_near_180(scale):
    R, angle_deg = exact_rotation(1, 2 * scale, -3 * scale, 6 * scale)
    assert rotation_error_deg(R, np.eye(3)) == pytest.approx(angle_deg, abs=1e-12)


def test_angle_at_180_about_every_axis():
    for axis in np.eye(3):
        assert rotation_error_deg(2 * np.outer(axis, axis) - np.eye(3), np.eye(3)) == pytest.approx(180, abs=1e-12)


@given(SEEDS, st.floats(0, 180))
def test_angle_agrees_with_scipy_to_1e_8_deg(seed, angle_deg):
    rng = np.random.default_rng(seed)
    truth = Rotation.random(20, rng=rng)
    axes = rng.normal(size=(20, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    moved = truth * Rotation.from_rotvec(np.radians(angle_deg) * axes)
    errors = rotation_error_deg(moved.as_matrix(), truth.as_matrix())
    assert errors.shape == (20,)
    np.testing.assert_allclose(errors, angle_deg, atol=1e-8)
    np.testing.assert_allclose(errors, np.degrees((truth.inv() * moved).magnitude()), atol=1e-8)


@given(SEEDS)
def test_angle_of_matrices_off_orthonormal_is_that_of_the_nearest_rotations(seed):
    rng = np.random.default_rng(seed)
    off = [Rotation.random(8, rng=rng).as_matrix() + rng.uniform(-1e-6, 1e-6, (8, 3, 3)) for _ in range(2)]
    U, _, Vt = zip(*(np.linalg.svd(matrices) for matrices in off), strict=True)
    nearest = [u @ vt for u, vt in zip(U, Vt, strict=True)]
    np.testing.assert_allclose(nearest_rotation(off[0]), nearest[0], atol=1e-14)
    np.testing.assert_allclose(rotation_error_deg(*off), rotation_error_deg(*nearest), atol=1e-8)


def test_float32_answers_keep_small_angles():
    R = Rotation.from_rotvec([0, 0, np.radians(0.01)]).as_matrix().astype(np.float32)
    assert rotation_error_deg(R, np.eye(3)) == pytest.approx(0.01, abs=1e-5)


@given(SEEDS)
def test_angle_is_symmetric_and_does_not_depend_on_the_frame(seed):
    rng = np.random.default_rng(seed)
    A, B, frame, other = (Rotation.random(5, rng=rng).as_matrix() for _ in range(4))
    errors = rotation_error_deg(A, B)
    np.testing.assert_allclose(rotation_error_deg(B, A), errors, atol=1e-8)
    np.testing.assert_allclose(rotation_error_deg(frame @ A @ other, frame @ B @ other), errors, atol=1e-8)
    assert ((errors >= 0) & (errors <= 180)).all()


def test_one_pair_or_many():
    R = Rotation.from_rotvec([[10, 0, 0], [20, 0, 0]], degrees=True).as_matrix()
    assert rotation_error_deg(R[0], np.eye(3)).shape == ()
    np.testing.assert_allclose(rotation_error_deg(R, np.eye(3)), [10, 20], atol=1e-12)


def test_euler_residuals_are_dcp_s():
    """SciPy's lower-case (extrinsic) zyx, as DCP's code extracts it, in the order x, y, z here."""
    rng = np.random.default_rng(3)
    estimates, truth = Rotation.random(50, rng=rng), Rotation.random(50, rng=rng)
    expected = (estimates.as_euler("zyx", degrees=True) - truth.as_euler("zyx", degrees=True))[:, ::-1]
    residuals = euler_residuals_deg(estimates.as_matrix(), truth.as_matrix())
    np.testing.assert_allclose(residuals, expected, atol=1e-9)


def test_euler_residuals_are_not_wrapped():
    estimate, truth = (Rotation.from_euler("x", angle, degrees=True).as_matrix() for angle in (-170, 170))
    np.testing.assert_allclose(euler_residuals_deg(estimate, truth), [-340, 0, 0], atol=1e-9)
    assert rotation_error_deg(estimate, truth) == pytest.approx(20)


def test_rmse_and_mae_go_over_pairs_and_axes_together():
    residuals = [[3.0, 0.0, 0.0], [0.0, -4.0, 1.0]]
    assert rmse(residuals) == pytest.approx(math.sqrt(26 / 6))
    assert mae(residuals) == pytest.approx(8 / 6)


@given(st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 3), min_size=1, max_size=40))
def test_rmse_lies_between_mae_and_its_bound(rows):
    root, mean = rmse(rows), mae(rows)
    assert root >= mean * (1 - 1e-12) - 1e-150
    assert root <= mean * rmse_to_mae_bound(len(rows)) * (1 + 1e-12) + 1e-150


def test_the_bound_is_reached_by_one_wrong_axis():
    residuals = np.zeros((57, 3))
    residuals[4, 1] = 9.0
    assert rmse(residuals) / mae(residuals) == pytest.approx(rmse_to_mae_bound(57)) == pytest.approx(math.sqrt(171))


def test_no_pairs_is_not_a_number():
    assert math.isnan(rmse(np.empty((0, 3))))
    assert math.isnan(mae(np.empty((0, 3))))
