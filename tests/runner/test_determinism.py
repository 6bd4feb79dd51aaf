"""Same seed, same result: whatever the number of jobs and the order of methods."""

import numpy as np
import pytest

from tests.runner.helpers import run_here

METHODS = ["icp", "fgr", "ransac", "kiss_icp", "small_gicp", "gicp", "random"]


def answers(rows):
    return {(row["method"], row["problem"], row["repeat"]): row["T_target_source"] for row in rows}


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    rows, _ = run_here(tmp_path_factory.mktemp("run"), method=METHODS, limit=4, plugin=[])
    assert {row["status"] for row in rows} == {"ok"}
    return answers(rows)


def test_two_jobs_give_the_same_transforms(first, tmp_path):
    rows, _ = run_here(tmp_path, method=METHODS, limit=4, jobs=2, plugin=[])
    assert answers(rows) == first


def test_the_order_of_methods_does_not_matter(first, tmp_path):
    rows, _ = run_here(tmp_path, method=METHODS[::-1], limit=4, plugin=[])
    assert answers(rows) == first


def test_another_seed_changes_random_methods_alone(first, tmp_path):
    rows, _ = run_here(tmp_path, method=["icp", "random"], limit=4, seed=1, plugin=[])
    for key, T in answers(rows).items():
        assert np.array_equal(T, first[key]) == (key[0] == "icp")


def test_trials_ran_on_one_thread_and_one_core(tmp_path):
    rows, _ = run_here(tmp_path, method=["fgr", "kiss_icp", "small_gicp"], limit=3, plugin=[])
    for row in rows:
        assert len(row["cores"]) == 1
        assert row["cpu_ms"] <= row["time_ms"] * 1.05 + 1, "a method on one core cannot use more CPU than wall time"


def test_more_jobs_than_cores_are_refused(tmp_path):
    from regbench.errors import UserError

    with pytest.raises(UserError, match="timed trials never share a core"):
        run_here(tmp_path, method=["identity"], limit=1, jobs=64, plugin=[])
