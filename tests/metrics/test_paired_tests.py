"""Tests on pairs: by hand, against SciPy's exact distribution, and against what their definitions say."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import wilcoxon

from regbench.metrics.paired_tests import holm, probability_of_improvement, signed_rank_p


def test_p_is_near_the_exact_one():
    rng = np.random.default_rng(0)
    better = rng.uniform(size=49)  # SciPy's exact distribution has no more
    worse = better + rng.normal(0.01, 0.05, 49)
    exact = wilcoxon(worse, better, alternative="greater", method="exact").pvalue
    assert signed_rank_p(worse, better, higher_is_better=False) == pytest.approx(exact, rel=0.15)
    assert signed_rank_p(-worse, -better, higher_is_better=True) == pytest.approx(exact, rel=0.15)


def test_p_by_all_signs():
    """Every sign of the differences is as likely as the other where the methods are equal."""
    differences = np.array([0.1, -0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.4, -1.5, 1.7, 1.9])
    ranks = np.argsort(np.argsort(np.abs(differences))) + 1
    sums = np.array(list(itertools.product((0, 1), repeat=12))) @ ranks
    exact = np.mean(sums >= ranks[differences > 0].sum())
    assert signed_rank_p(differences, np.zeros(12), higher_is_better=False) == pytest.approx(exact, abs=0.005)


def test_trials_on_which_both_are_equal_say_nothing():
    rng = np.random.default_rng(1)
    better = rng.uniform(size=30)
    worse = better + rng.uniform(size=30) - 0.3
    padded = [np.concatenate([values, np.ones(500)]) for values in (worse, better)]
    assert signed_rank_p(*padded, higher_is_better=False) == signed_rank_p(worse, better, higher_is_better=False)
    assert signed_rank_p(better, better, higher_is_better=False) == 1.0


def test_hits_are_compared_as_mcnemar_does():
    """Of 20 trials on which one hits and the other misses, 18 go one way: p of a fair coin about 0.0002."""
    worse = np.array([0] * 18 + [1] * 2 + [1] * 100, dtype=float)
    better = np.array([1] * 18 + [0] * 2 + [1] * 100, dtype=float)
    assert 1e-5 < signed_rank_p(worse, better, higher_is_better=True) < 1e-3


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_rejects_what_its_definition_rejects(p):
    """Step down: the smallest p against alpha / m, the next against alpha / (m - 1), until one is not under it."""
    corrected = holm(p)
    for alpha in (0.001, 0.01, 0.05, 0.3):
        rejected = set()
        for step, index in enumerate(np.argsort(p, kind="stable")):
            if not p[index] * (len(p) - step) < alpha:
                break
            rejected.add(int(index))
        assert {index for index, value in enumerate(corrected) if value < alpha} == rejected


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([]) == []


def test_probability_of_improvement_is_over_all_trials():
    first, second = np.array([1.0, 2, 3, 4]), np.array([0.5, 2, 4, 3])
    assert probability_of_improvement(first, second, higher_is_better=False) == pytest.approx(0.625)
    assert probability_of_improvement(first, second, higher_is_better=True) == pytest.approx(0.375)
    assert np.isnan(probability_of_improvement(np.empty(0), np.empty(0), higher_is_better=True))
