import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regbench.geometry.kabsch import kabsch
from regbench.geometry.se3 import se3, transform, why_not_rigid

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.integers(4, 60), st.booleans())
def test_agrees_with_scipys_align_vectors_on_noisy_points(seed, count, weighted):
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(count, 3))
    target = source @ Rotation.random(rng=rng).as_matrix().T + rng.normal(size=3) + 0.05 * rng.normal(size=(count, 3))
    weights = rng.uniform(0.1, 1, count) if weighted else None
    source_mean = np.average(source, axis=0, weights=weights)
    target_mean = np.average(target, axis=0, weights=weights)
    rotation, _ = Rotation.align_vectors(target - target_mean, source - source_mean, weights=weights)
    expected = se3(rotation.as_matrix(), target_mean - rotation.apply(source_mean))
    np.testing.assert_allclose(kabsch(source, target, weights), expected, atol=1e-6)


@given(seeds)
def test_recovers_a_motion_exactly(seed):
    rng = np.random.default_rng(seed)
    T = se3(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3))
    source = rng.normal(size=(30, 3))
    np.testing.assert_allclose(kabsch(source, transform(T, source)), T, atol=1e-12)


def test_weight_zero_is_the_same_as_leaving_a_match_out():
    rng = np.random.default_rng(0)
    source, target = rng.normal(size=(10, 3)), rng.normal(size=(10, 3))
    weights = np.r_[np.ones(6), np.zeros(4)]
    np.testing.assert_allclose(kabsch(source, target, weights), kabsch(source[:6], target[:6]), atol=1e-12)


@given(seeds)
def test_a_mirrored_cloud_gets_a_rotation_and_no_small_turn_improves_it(seed):
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(20, 3))
    target = source * (1, 1, -1)
    T = kabsch(source, target)
    assert why_not_rigid(T) is None
    best = ((transform(T, source) - target) ** 2).sum()
    centre = target.mean(axis=0)
    for turn in Rotation.from_rotvec(0.05 * rng.normal(size=(20, 3))).as_matrix():
        turned = (transform(T, source) - centre) @ turn.T + centre
        assert ((turned - target) ** 2).sum() >= best - 1e-9


line = np.outer(np.linspace(-1, 1, 9), (1.0, 2.0, -1.0))


@pytest.mark.parametrize(
    "source",
    [np.zeros((5, 3)), np.full((5, 3), 3.0), line, line[:1], line[:2], np.eye(3)[:2], np.eye(3)],
    ids=["zeros", "equal", "line", "one", "two of a line", "two", "three"],
)
def test_points_that_do_not_determine_the_rotation_are_still_matched(source):
    T_true = se3(Rotation.from_euler("x", 40, degrees=True).as_matrix(), (1, 2, 3))
    target = transform(T_true, source)
    T = kabsch(source, target)
    assert why_not_rigid(T, tolerance=1e-12) is None
    np.testing.assert_allclose(transform(T, source), target, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((np.zeros((3, 3)), np.zeros((4, 3))), r"matched points, got \(3, 3\) and \(4, 3\)"),
        ((np.zeros((3, 2)), np.zeros((3, 2))), "matched points"),
        ((np.zeros((0, 3)), np.zeros((0, 3))), "matched points"),
        ((np.zeros((2, 3)), np.zeros((2, 3)), [1.0]), "one weight per point"),
        ((np.zeros((2, 3)), np.zeros((2, 3)), [1.0, -1.0]), "not negative"),
        ((np.zeros((2, 3)), np.zeros((2, 3)), [0.0, 0.0]), "not all zero"),
        ((np.zeros((2, 3)), np.zeros((2, 3)), [np.nan, 1.0]), "finite weights"),
    ],
)
def test_bad_input_is_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        kabsch(*arguments)
