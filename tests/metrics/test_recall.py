"""Recall and its curve."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regbench.metrics.recall import THRESHOLDS, recall, recall_curve


def test_both_errors_must_be_within_and_the_thresholds_are_inclusive():
    rotation, translation = [5.0, 5.0, 5.1, 0.0], [0.05, 0.06, 0.0, 0.0]
    assert recall(rotation, translation, 5, 0.05) == 0.5


def test_no_pairs_is_not_a_number():
    assert math.isnan(recall([], [], 5, 0.05))
    assert np.isnan(recall_curve([], [], [1, 5], 100)).all()


def test_lengths_must_agree():
    with pytest.raises(ValueError, match=r"\(2,\) rotation errors but \(1,\) translation errors"):
        recall([1, 2], [1], 5, 0.05)
    with pytest.raises(ValueError, match=r"\(2,\) rotation errors but \(1,\) translation errors"):
        recall_curve([1, 2], [1], [5], 100)


def test_the_curve_passes_through_the_tables_thresholds():
    rng = np.random.default_rng(0)
    rotation, translation = rng.uniform(0, 20, 300), rng.uniform(0, 0.2, 300)
    degrees = [degrees for degrees, _ in THRESHOLDS.values()]
    expected = [recall(rotation, translation, *threshold) for threshold in THRESHOLDS.values()]
    np.testing.assert_array_equal(recall_curve(rotation, translation, degrees, 100), expected)


@given(st.lists(st.tuples(st.floats(0, 180), st.floats(0, 2)), min_size=1, max_size=50))
def test_the_curve_never_falls_and_ends_at_1(pairs):
    rotation, translation = np.array(pairs).T
    curve = recall_curve(rotation, translation, [0, 1, 5, 15, 90, 180, 1e4], 100)
    assert (np.diff(curve) >= 0).all()
    assert curve[-1] == 1
