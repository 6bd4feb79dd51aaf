"""The table of metrics: complete, consistent, and score() over it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from regbench.errors import UserError
from regbench.metrics.rotation import mae, rmse
from regbench.metrics.samples import Samples
from regbench.metrics.table import METRICS, find_metrics, score

ISSUE_KEYS = [
    "rmse_r_deg",
    "rmse_t",
    "mae_r_deg",
    "mae_t",
    "rre_mean_deg",
    "rre_median_deg",
    "rte_mean",
    "rte_median",
    "recall_1deg",
    "recall_5deg",
    "recall_15deg",
    "time_median_ms",
    "time_p95_ms",
    "cpu_median_ms",
]


def motions(rng, n):
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, :3] = Rotation.random(n, rng=rng).as_matrix()
    T[:, :3, 3] = rng.normal(size=(n, 3))
    return T


def test_the_table_has_the_figures_of_the_json_format_in_order():
    assert list(METRICS)[: len(ISSUE_KEYS)] == ISSUE_KEYS


def test_every_metric_says_what_it_is():
    for key, metric in METRICS.items():
        assert metric.key == key
        assert metric.name
        assert metric.source
        assert metric.higher_is_better == key.startswith("recall")
        assert metric.needs in ("motions", "times", "clouds")
    assert len({metric.name for metric in METRICS.values()}) == len(METRICS)


def test_score_by_hand():
    estimates, truth = np.tile(np.eye(4), (2, 2, 1, 1))
    estimates[0, :3, :3] = Rotation.from_euler("x", 3, degrees=True).as_matrix()
    estimates[1, :3, 3] = (0, 0, 0.04)
    figures = score(estimates, truth)
    expected = {
        "rmse_r_deg": math.sqrt(9 / 6),
        "rmse_t": math.sqrt(0.0016 / 6),
        "mae_r_deg": 0.5,
        "mae_t": 0.04 / 6,
        "rre_mean_deg": 1.5,
        "rre_median_deg": 1.5,
        "rte_mean": 0.02,
        "rte_median": 0.02,
        "recall_1deg": 0,
        "recall_5deg": 1,
        "recall_15deg": 1,
        "rre_p75_deg": 2.25,
        "rre_p95_deg": 2.85,
        "rte_p75": 0.03,
        "rte_p95": 0.038,
    }
    assert list(figures) == list(expected)
    assert figures == pytest.approx(expected)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_score_does_not_depend_on_the_order_of_trials(seed, n):
    rng = np.random.default_rng(seed)
    estimates, truth = motions(rng, n), motions(rng, n)
    order = rng.permutation(n)
    assert score(estimates[order], truth[order]) == pytest.approx(score(estimates, truth))


def test_the_truth_scores_zero_and_full_recall():
    truth = motions(np.random.default_rng(5), 30)
    figures = score(truth, truth)
    assert all(figures[key] == 0 for key in figures if not key.startswith("recall"))
    assert all(figures[key] == 1 for key in figures if key.startswith("recall"))


def test_nothing_scored_is_not_a_number():
    assert all(math.isnan(value) for value in score(np.empty((0, 4, 4)), np.empty((0, 4, 4))).values())


def test_times_are_medians_and_a_95th_percentile():
    samples = Samples.of_motions(np.empty((0, 4, 4)), np.empty((0, 4, 4)), time_ms=np.arange(101.0))
    assert METRICS["time_median_ms"].figure(samples) == 50
    assert METRICS["time_p95_ms"].figure(samples) == 95
    assert math.isnan(METRICS["cpu_median_ms"].figure(samples))


def test_rmse_and_mae_are_those_of_all_pairs_and_axes():
    rng = np.random.default_rng(2)
    estimates, truth = motions(rng, 20), motions(rng, 20)
    samples, figures = Samples.of_motions(estimates, truth), score(estimates, truth)
    assert figures["rmse_r_deg"] == pytest.approx(rmse(samples.rotation_residuals_deg))
    assert figures["mae_t"] == pytest.approx(mae(samples.translation_residuals))


def test_wrong_shapes_and_values_are_refused():
    with pytest.raises(ValueError, match=r"expected \(n, 4, 4\) estimates and truths, got \(4, 4\) and \(4, 4\)"):
        score(np.eye(4), np.eye(4))
    with pytest.raises(ValueError, match=r"got \(2, 4, 4\) and \(1, 4, 4\)"):
        score(np.zeros((2, 4, 4)), np.zeros((1, 4, 4)))
    with pytest.raises(ValueError, match="a motion has values that are not finite; score a failed trial as the ident"):
        score(np.full((1, 4, 4), np.nan), np.eye(4)[None])


def test_an_unknown_metric_gets_a_suggestion():
    with pytest.raises(UserError, match="unknown metric 'rmse_r_degs'; did you mean 'rmse_r_deg'"):
        find_metrics(["mae_t", "rmse_r_degs"])
