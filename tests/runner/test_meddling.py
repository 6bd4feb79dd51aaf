"""A method that meddles with its worker costs its own trials, and no answer is ever another problem's."""

import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest

from regbench.errors import UserError
from tests.runner.helpers import rows_of, run_here

MEDDLING = Path(__file__).with_name("meddling_methods.py")
PLUGIN = [str(MEDDLING)]
ODD_THEN_EVEN = {"seed": 6, "limit": 2}  # of the problems' seeds: the first trial meddles, the second is sent ahead
EXPECTED = {
    "returns_twice": ("ok", None),
    "writes_everywhere": ("crashed", None),
    "writes_text": ("crashed", "closed its connection or wrote to it"),
    "closes_all": ("crashed", None),
    "forges_list": ("crashed", "something other than an answer"),
    "forges_nan": ("crashed", "something other than an answer"),
    "forges_status": ("crashed", "something other than an answer"),
    "stops_itself": ("timeout", "no answer after 3 s"),
    "dies_of_odd_signal": ("crashed", "killed by signal 40"),
}


@pytest.fixture(scope="module")
def by_method(tmp_path_factory):
    out = tmp_path_factory.mktemp("meddling")
    rows, _ = run_here(out, method=[",".join(EXPECTED)], timeout=3.0, plugin=PLUGIN, **ODD_THEN_EVEN)
    found = defaultdict(dict)
    for row in rows:
        assert row["problem"] not in found[row["method"]], "a trial has one row"
        found[row["method"]][row["problem"]] = row
    return found


@pytest.mark.parametrize("method", EXPECTED)
def test_meddling_costs_its_own_trials_alone(by_method, method):
    status, words = EXPECTED[method]
    first, second = by_method[method][0], by_method[method][1]
    assert first["status"] == status, first
    assert words is None or words in first["error"], first
    assert second["status"] == "ok", second


def test_a_forked_child_does_not_answer(by_method):
    assert [by_method["returns_twice"][problem]["T_target_source"][0][3] for problem in (0, 1)] == [0.0, 0.0]


def test_an_earlier_workers_last_words_are_not_this_ones(tmp_path):
    method = [f"runs_out_then_segfaults[flag={tmp_path / 'flag'}]"]
    rows, _ = run_here(tmp_path / "run", method=method, seed=7, limit=3, plugin=PLUGIN)
    failed = [(row["status"], row["error"].split(" (")[0]) for row in rows if row["status"] != "ok"]
    assert failed == [("oom", "died without memory"), ("crashed", "killed by SIGSEGV")]


def test_a_log_that_cannot_be_opened_does_not_stop_the_method(tmp_path):
    """The name of a method with its parameters can be longer than a file's may be."""
    rows, _ = run_here(tmp_path, method=[f"prints[note={'x' * 300}]"], plugin=PLUGIN, **ODD_THEN_EVEN)
    assert [row["status"] for row in rows] == ["ok", "ok"]


def test_a_file_in_the_users_folder_does_not_hide_a_module(tmp_path):
    (tmp_path / "random.py").write_text("raise RuntimeError('mine')\n")
    command = [Path(sys.executable).with_name("regbench"), "run", "-m", "identity", "--limit", "1", "--out", "run"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    assert [row["status"] for row in rows_of(tmp_path / "run")] == ["ok"]


def test_a_submodule_of_a_missing_package_is_missing(tmp_path):
    rows, _ = run_here(tmp_path, method=["needs_submodule"], limit=1, plugin=PLUGIN)
    assert [(row["status"], row["error"].split(":")[0]) for row in rows] == [
        ("missing", "needs a_package_that_nobody_has.part")
    ]


def test_a_parameter_that_cannot_reach_a_worker_is_named(tmp_path):
    with pytest.raises(UserError, match=r"'has_path': parameter weights=.* is a PosixPath"):
        run_here(tmp_path / "run", method=["has_path"], limit=1, plugin=PLUGIN)
    assert not (tmp_path / "run").exists()


def test_an_oracle_without_a_truth_to_see_declines(tmp_path):
    import numpy as np

    np.save(tmp_path / "a.npy", np.eye(3))
    (tmp_path / "pairs.csv").write_text("source,target\na.npy,a.npy\n")
    rows, _ = run_here(tmp_path / "run", method=["oracle"], protocol=[f"pairs:{tmp_path}"], plugin=[])
    assert [(row["status"], row["error"]) for row in rows] == [("skipped", "nobody knows this problem's ground truth")]
