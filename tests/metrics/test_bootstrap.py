"""Intervals of differences: against SciPy's bootstrap, and against the same resamples written out."""

import numpy as np
import pytest
from scipy.stats import bootstrap

from regbench.metrics.bootstrap import PairedValues, paired_intervals
from regbench.metrics.reduction import reduce

REDUCTIONS = ("mean", "root mean", "median", "p75", "p95")


def pairs(n, seed=0):
    rng = np.random.default_rng(seed)
    first = rng.gamma(2.0, 1.0, n)
    return first, first * rng.uniform(0.7, 1.2, n)


@pytest.mark.parametrize("reduction", REDUCTIONS)
def test_limits_are_scipys(reduction):
    first, second = pairs(150)
    ((low, high),) = paired_intervals([PairedValues(first, second, reduction)], np.random.default_rng(1))
    expected = bootstrap(
        (second, first),
        lambda a, b: reduce(a, reduction) - reduce(b, reduction),
        paired=True,
        vectorized=False,
        method="percentile",
        n_resamples=4000,
        rng=np.random.default_rng(2),
    ).confidence_interval
    width = expected.high - expected.low
    assert low == pytest.approx(expected.low, abs=0.08 * width)
    assert high == pytest.approx(expected.high, abs=0.08 * width)


@pytest.mark.parametrize("reduction", REDUCTIONS)
@pytest.mark.parametrize("n", [1, 2, 7, 40])
def test_each_resample_has_the_figures_of_the_trials_it_drew(reduction, n):
    """The same draws, written out: a level of nearly 1 returns the least and the largest difference."""
    first, second = pairs(n, seed=n)
    ((low, high),) = paired_intervals(
        [PairedValues(first, second, reduction)], np.random.default_rng(3), resamples=60, level=1.0
    )
    drawn = np.random.default_rng(3).integers(0, n, (60, n))
    differences = [reduce(second[row], reduction) - reduce(first[row], reduction) for row in drawn]
    assert low == pytest.approx(min(differences))
    assert high == pytest.approx(max(differences))


def test_metrics_of_the_same_trials_share_the_draws():
    first, second = pairs(80)
    column = PairedValues(first, second, "mean")
    assert len(set(paired_intervals([column, column], np.random.default_rng(0), resamples=200))) == 1


def test_a_method_does_not_differ_from_itself():
    first, _ = pairs(30)
    columns = [PairedValues(first, first, reduction) for reduction in REDUCTIONS]
    assert paired_intervals(columns, np.random.default_rng(0), resamples=100) == [(0.0, 0.0)] * len(columns)


def test_lengths_that_differ_are_refused():
    with pytest.raises(ValueError, match=r"as many of each and at least one, got \[2, 3\]"):
        paired_intervals([PairedValues(np.ones(2), np.ones(3), "mean")], np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"got \[0\]"):
        paired_intervals([PairedValues(np.empty(0), np.empty(0), "mean")], np.random.default_rng(0))
