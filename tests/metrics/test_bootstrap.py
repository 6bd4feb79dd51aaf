"""Intervals of differences: against SciPy's bootstrap, and against the same resamples written out."""

import numpy as np
import pytest
from scipy.stats import bootstrap

from regbench.metrics.bootstrap import AT_ONCE, PairedValues, figure_intervals, paired_intervals
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


@pytest.mark.parametrize("reduction", REDUCTIONS)
def test_limits_of_a_figure_are_scipys_of_the_same_draws(reduction):
    values, _ = pairs(150)
    (found,) = figure_intervals([(values, reduction)], np.arange(150), np.random.default_rng(1), resamples=2000)
    expected = bootstrap(
        (values,),
        lambda a: reduce(a, reduction),
        vectorized=False,
        method="percentile",
        n_resamples=2000,
        batch=AT_ONCE,
        rng=np.random.default_rng(1),
    ).confidence_interval
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("reduction", REDUCTIONS)
def test_problems_are_drawn_with_all_their_trials(reduction):
    """The same draws, written out, of problems that have one to three trials."""
    problems = np.array([5, 0, 0, 7, 5, 9, 9, 9, 2])
    values, _ = pairs(len(problems), seed=4)
    ((low, high),) = figure_intervals(
        [(values, reduction)], problems, np.random.default_rng(3), resamples=60, level=1.0
    )
    numbers = np.unique(problems)
    drawn = np.random.default_rng(3).integers(0, len(numbers), (60, len(numbers)))
    figures = [reduce(np.concatenate([values[problems == numbers[i]] for i in row]), reduction) for row in drawn]
    assert low == pytest.approx(min(figures))
    assert high == pytest.approx(max(figures))


@pytest.mark.parametrize("reduction", ["mean", "root mean"])
def test_answering_the_same_ten_times_makes_no_figure_surer(reduction):
    values, _ = pairs(40)
    once = figure_intervals([(values, reduction)], np.arange(40), np.random.default_rng(0), resamples=300)
    ten = figure_intervals(
        [(np.repeat(values, 10), reduction)], np.repeat(np.arange(40), 10), np.random.default_rng(0), resamples=300
    )
    np.testing.assert_allclose(ten, once)


def test_an_interval_covers_the_truth_as_often_as_it_says():
    """Medians of 60 exponential values: of 300 intervals about 95 % hold the true one, log 2."""
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(300):
        values = rng.exponential(size=60)
        ((low, high),) = figure_intervals([(values, "median")], np.arange(60), rng, resamples=400)
        held += low <= np.log(2) <= high
    assert 0.91 < held / 300 < 0.985


def test_values_that_are_not_as_many_as_problems_are_refused():
    with pytest.raises(ValueError, match=r"as many as problems and at least one, got \[2\] and 3"):
        figure_intervals([(np.ones(2), "mean")], np.arange(3), np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"got \[0\] and 0"):
        figure_intervals([(np.empty(0), "mean")], np.arange(0), np.random.default_rng(0))
