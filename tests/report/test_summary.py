"""The figures of a row, by hand."""

import math

import numpy as np
import pytest

from regbench.report.rundata import read_run
from regbench.report.summary import summarise
from tests.report.helpers import example_run, method, motion, protocol, row, write_run

FIRST_KEYS = [
    *("method", "protocol", "n", "failures", "rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t"),
    *("rre_mean_deg", "rre_median_deg", "rte_mean", "rte_median"),
    *("recall_1deg", "recall_5deg", "recall_15deg", "time_median_ms", "time_p95_ms", "cpu_median_ms"),
]


@pytest.fixture
def rows(tmp_path):
    found = summarise(read_run(example_run(tmp_path)))
    return {(row["method"], row["protocol"]): row for row in found}


def test_keys_come_in_the_order_of_the_json_format(rows):
    for found in rows.values():
        assert list(found)[: len(FIRST_KEYS)] == FIRST_KEYS


def test_every_method_has_a_row_on_every_protocol(rows):
    assert len(rows) == 14


def test_figures_by_hand(rows):
    icp = rows["icp", "demo@1"]
    assert (icp["n"], icp["failures"]) == (4, {})
    assert icp["rmse_r_deg"] == pytest.approx(2 / math.sqrt(3))  # 2 deg on one axis of three
    assert icp["mae_r_deg"] == pytest.approx(2 / 3)
    assert icp["rre_mean_deg"] == pytest.approx(2)
    assert icp["rre_median_deg"] == pytest.approx(2)
    assert (icp["recall_1deg"], icp["recall_5deg"]) == (0, 1)
    assert (icp["time_median_ms"], icp["time_p95_ms"]) == (2.5, pytest.approx(3.85))
    odd = rows["od_d%[a&b=#1,c={x}]", "demo@1"]
    assert odd["rte_mean"] == pytest.approx(0.2)
    assert odd["rmse_t"] == pytest.approx(0.2 / math.sqrt(3))
    assert (odd["recall_5deg"], odd["recall_15deg"]) == (0, 0)  # 0.2 is too far even where 6 deg is not


def test_a_failed_trial_is_scored_as_the_identity(rows):
    failing, identity = rows["failing", "demo@1"], rows["identity", "demo@1"]
    assert failing["failures"] == {"invalid": 1, "timeout": 2, "crashed": 1}
    accuracy = FIRST_KEYS[4:15]
    assert [failing[key] for key in accuracy] == [identity[key] for key in accuracy]
    assert failing["rmse_r_deg"] == pytest.approx(math.sqrt((100 + 400 + 900 + 1600) / 12))
    assert [failing[key] for key in FIRST_KEYS[15:]] == [None] * 3


def test_times_are_of_the_trials_that_answered(rows):
    failing = rows["failing", "modelnet40/clean@1"]
    assert (failing["n"], failing["failures"]) == (4, {"oom": 3})
    assert failing["time_median_ms"] == failing["time_p95_ms"] == failing["cpu_median_ms"] == 9.0
    assert failing["recall_1deg"] == 0.25


def test_an_unfinished_row_says_what_was_planned(rows):
    assert [rows["unfinished", "demo@1"][key] for key in ("n", "planned")] == [2, 4]
    nothing = rows["unfinished", "modelnet40/clean@1"]
    assert [nothing[key] for key in ("n", "planned")] == [0, 4]
    assert all(nothing[key] is None for key in FIRST_KEYS[4:])


def test_repeats_are_trials(tmp_path):
    m, p = method("icp"), protocol("demo@1", [motion((10, 0, 0))])
    trials = [row(m, p, 0, motion((10 + 3 * repeat, 0, 0)), repeat=repeat, time_ms=repeat) for repeat in range(3)]
    (found,) = summarise(read_run(write_run(tmp_path, [m], [p], trials, repeat=3)))
    assert (found["n"], found["planned"]) == (3, 3)
    assert found["rre_mean_deg"] == pytest.approx(3)


def test_problems_of_unknown_truth_are_not_scored_for_accuracy(tmp_path):
    m, p = method("icp"), protocol("pairs:x", [motion((10, 0, 0)), None, None])
    trials = [
        row(m, p, 0, motion((11, 0, 0)), time_ms=1.0),
        row(m, p, 1, motion((90, 0, 0)), time_ms=3.0),
        row(m, p, 2, status="error"),
    ]
    (found,) = summarise(read_run(write_run(tmp_path, [m], [p], trials)))
    assert (found["n"], found["n_truth"], found["failures"]) == (3, 1, {"error": 1})
    assert found["rre_mean_deg"] == pytest.approx(1)
    assert found["time_median_ms"] == 2.0


def test_no_truth_at_all_leaves_only_times(tmp_path):
    m, p = method("icp"), protocol("pairs:x", [None])
    (found,) = summarise(read_run(write_run(tmp_path, [m], [p], [row(m, p, 0, np.eye(4), time_ms=1.0)])))
    assert found["rmse_r_deg"] is found["recall_5deg"] is None
    assert found["time_median_ms"] == 1.0
