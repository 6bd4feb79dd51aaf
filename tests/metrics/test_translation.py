"""Translation metrics against the definition by matrices."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regbench.metrics.translation import translation_error, translation_residuals


def motions(rng, n):
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, :3] = Rotation.random(n, rng=rng).as_matrix()
    T[:, :3, 3] = rng.normal(size=(n, 3))
    return T


@given(st.integers(0, 2**32 - 1))
def test_isotropic_error_is_the_norm_of_the_relative_motion_s_translation(seed):
    rng = np.random.default_rng(seed)
    estimates, truth = motions(rng, 6), motions(rng, 6)
    relative = np.linalg.inv(truth) @ estimates
    expected = np.linalg.norm(relative[:, :3, 3], axis=1)
    np.testing.assert_allclose(translation_error(estimates, truth), expected, rtol=1e-9)
    np.testing.assert_allclose(translation_error(truth, estimates), expected, rtol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_isotropic_error_does_not_depend_on_the_target_s_frame(seed):
    rng = np.random.default_rng(seed)
    estimates, truth, frame = motions(rng, 4), motions(rng, 4), motions(rng, 1)
    np.testing.assert_allclose(
        translation_error(frame @ estimates, frame @ truth), translation_error(estimates, truth), rtol=1e-9
    )


def test_residuals_are_predicted_minus_true():
    estimate, truth = np.eye(4), np.eye(4)
    estimate[:3, 3], truth[:3, 3] = (1, 2, 3), (0.5, 2, 5)
    np.testing.assert_array_equal(translation_residuals(estimate, truth), [0.5, 0, -2])
