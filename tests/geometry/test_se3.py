import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regbench.geometry.se3 import (
    euler_deg_from_rotation,
    invert,
    nearest_rigid,
    rotation_from_euler_deg,
    se3,
    transform,
    why_not_rigid,
)

angles = st.tuples(*[st.floats(-180, 180)] * 3)
seeds = st.integers(0, 2**32 - 1)


def random_motion(rng):
    return se3(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3))


@given(angles)
def test_rotation_is_rx_ry_rz_and_scipys_extrinsic_zyx_on_the_reversed_triple(xyz):
    x, y, z = xyz
    ours = rotation_from_euler_deg(xyz)
    np.testing.assert_allclose(ours, Rotation.from_euler("zyx", (z, y, x), degrees=True).as_matrix(), atol=1e-14)
    product = (
        Rotation.from_euler("x", x, degrees=True)
        * Rotation.from_euler("y", y, degrees=True)
        * Rotation.from_euler("z", z, degrees=True)
    )
    np.testing.assert_allclose(ours, product.as_matrix(), atol=1e-14)


@given(st.tuples(st.floats(-180, 180), st.floats(-89.9, 89.9), st.floats(-180, 180)))
def test_angles_are_scipys(xyz):
    rotation = Rotation.from_euler("zyx", xyz[::-1], degrees=True)
    difference = euler_deg_from_rotation(rotation.as_matrix()) - rotation.as_euler("zyx", degrees=True)[::-1]
    difference = (difference + 180) % 360 - 180  # -180 and 180 are one angle
    np.testing.assert_allclose(difference, 0, atol=1e-9)


@given(angles)
def test_angles_give_the_rotation_back(xyz):
    rotation = rotation_from_euler_deg(xyz)
    np.testing.assert_allclose(rotation_from_euler_deg(euler_deg_from_rotation(rotation)), rotation, atol=1e-12)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("away_deg", [0.0, 1e-13, 1e-10, 1e-8, 1e-6, 1e-3])
def test_gimbal_lock_gives_the_rotation_back(sign, away_deg):
    rotation = rotation_from_euler_deg((20.0, sign * (90 - away_deg), 35.0))
    found = euler_deg_from_rotation(rotation)
    np.testing.assert_allclose(rotation_from_euler_deg(found), rotation, atol=1e-11)
    if away_deg == 0:
        assert found[0] == 0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # SciPy announces the lock
            scipys = Rotation.from_matrix(rotation).as_euler("zyx", degrees=True)[::-1]
        np.testing.assert_allclose(found, scipys, atol=1e-9)


def test_angles_of_many_rotations_are_those_of_each():
    rotations = Rotation.random(50, rng=np.random.default_rng(0)).as_matrix().reshape(5, 10, 3, 3)
    together = euler_deg_from_rotation(rotations)
    assert together.shape == (5, 10, 3)
    for index in np.ndindex(5, 10):
        np.testing.assert_array_equal(together[index], euler_deg_from_rotation(rotations[index]))


@given(seeds)
def test_invert_and_transform(seed):
    rng = np.random.default_rng(seed)
    T, points = random_motion(rng), rng.normal(size=(20, 3))
    np.testing.assert_allclose(invert(T), np.linalg.inv(T), atol=1e-12)
    np.testing.assert_allclose(transform(invert(T), transform(T, points)), points, atol=1e-12)
    homogeneous = np.c_[points, np.ones(20)] @ T.T
    np.testing.assert_allclose(transform(T, points), homogeneous[:, :3], atol=1e-12)


def test_a_rigid_motion_has_nothing_against_it():
    T = random_motion(np.random.default_rng(1))
    assert why_not_rigid(T) is None
    assert why_not_rigid(T.astype(np.float32)) is None
    assert why_not_rigid(T.tolist()) is None


class NeedsGradient:
    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "not a matrix of numbers: NoneType"),
        (np.eye(4) * 1j, "not a matrix of numbers: ndarray (complex128)"),
        (np.eye(4).astype(str), "not a matrix of numbers"),
        ("abc", "not a matrix of numbers: str"),
        (object(), "not a matrix of numbers: object"),
        (NeedsGradient(), "not a matrix of numbers: NeedsGradient"),
        ([[1, 2], [3]], "not a matrix of numbers: list"),
        (np.eye(3), "shape (3, 3), expected (4, 4)"),
        (np.eye(4)[None], "shape (1, 4, 4)"),
        (np.full((4, 4), np.nan), "not finite"),
        (np.diag([1, 1, 1, np.inf]), "not finite"),
        (np.diag([1, 1, -1, 1]), "reflection"),
        (-np.eye(4), "last row"),
        (2 * np.eye(4), "last row"),
        (np.diag([2, 2, 2, 1]), "not orthonormal (off by 3)"),
        (np.diag([1e200, 1, 1, 1]), "not orthonormal"),
        (np.zeros((4, 4)), "last row"),
        (np.diag([1.001, 1, 1, 1]), "not orthonormal"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_is_not_rigid_is_said_in_words(value, words):
    assert words in (why_not_rigid(value) or "nothing")


@given(angles=st.tuples(*[st.floats(-180, 180)] * 3), off=st.floats(-0.004, 0.004))
def test_nearest_rigid_mends_what_printing_rounded(angles, off):
    T = se3(rotation_from_euler_deg(angles), [1, 2, 3])
    rough = T.copy()
    rough[0, 1] += off
    mended = nearest_rigid(rough)
    assert why_not_rigid(mended, tolerance=1e-12) is None
    np.testing.assert_allclose(mended, T, atol=0.01)
    np.testing.assert_array_equal(mended[:3, 3], T[:3, 3])


def test_nearest_rigid_against_scipy():
    rng = np.random.default_rng(0)
    for _ in range(20):
        T = np.eye(4)
        T[:3, :3] = Rotation.random(rng=rng).as_matrix() + rng.normal(size=(3, 3)) * 0.01
        T[:3, 3] = rng.normal(size=3)
        rigid = nearest_rigid(T)
        # SciPy projects a matrix to the nearest rotation in the same sense.
        np.testing.assert_allclose(rigid[:3, :3], Rotation.from_matrix(T[:3, :3]).as_matrix(), atol=1e-12)
        np.testing.assert_array_equal(rigid[:3, 3], T[:3, 3])
        assert np.linalg.det(rigid[:3, :3]) == pytest.approx(1)
    mirrored = nearest_rigid(np.diag([1.0, 1, -1, 1]))
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(1)
