"""Horn's rotation, against SciPy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regbench.geometry.horn import rotation_of_covariance


def found(source, target):
    rotation = np.empty((3, 3))
    rotation_of_covariance(source.T @ target, rotation)
    return rotation


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.01, 0.5]), st.integers(2, 3), st.integers(3, 40))
@settings(deadline=None, max_examples=150)
def test_it_is_scipys_also_of_planes(seed, noise, dimensions, count):
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(count, 3))
    source[:, dimensions:] = 0
    target = Rotation.random(rng=rng).apply(source) + noise * rng.normal(size=source.shape)
    expected = Rotation.align_vectors(target, source)[0].as_matrix()
    # Where the second best is about as good, both are right and may differ.
    singular = np.linalg.svd(source.T @ target, compute_uv=False)
    if singular[1] - singular[2] > 1e-3 * singular[0]:
        np.testing.assert_allclose(found(source, target), expected, atol=1e-9)


@pytest.mark.parametrize("source", [np.zeros((4, 3)), np.outer(np.arange(4.0), [1, 2, 3]), np.eye(3)[:1]])
def test_where_many_are_equally_good_it_is_one_of_them(source):
    target = Rotation.from_rotvec([0.3, -2, 1]).apply(source)
    rotation = found(source, target)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(source @ rotation.T, target, atol=1e-12)


def test_a_mirror_image_gets_a_rotation():
    source = np.random.default_rng(0).normal(size=(30, 3))
    assert np.linalg.det(found(source, source * [1, 1, -1])) == pytest.approx(1)


@pytest.mark.parametrize("scale", [1e-8, 1e8])
def test_the_scale_does_not_matter(scale):
    rng = np.random.default_rng(0)
    source = rng.normal(size=(30, 3))
    target = Rotation.random(rng=rng).apply(source)
    np.testing.assert_allclose(found(source * scale, target * scale), found(source, target), atol=1e-12)
