"""The fault matrix: a method that goes wrong costs its own trials alone, each with the right status."""

import time
from collections import defaultdict
from pathlib import Path

import psutil
import pytest

from tests.runner.helpers import run_here

PROBLEMS = 6

# What is expected of the trials with an odd seed: status, and words of the error.
EXPECTED = {
    "raises": ("error", r"RuntimeError: on purpose\x1b[31m"),
    "sleeps": ("timeout", "no answer after 3 s"),
    "ignores_sigterm": ("timeout", "no answer after 3 s"),
    "spins": ("timeout", "no answer after 3 s"),
    "segfaults": ("crashed", "SIGSEGV"),
    "exits": ("error", "SystemExit: enough"),
    "exits_hard": ("crashed", "exit code 3"),
    "allocates": ("oom", "limit 0.3 GB"),
    "prints": ("ok", None),
    "answers_nan": ("invalid", "not finite"),
    "answers_reflection": ("invalid", "reflection"),
    "answers_wrong_shape": ("invalid", "shape (3, 3)"),
    "answers_none": ("invalid", "returned NoneType"),
    "answers_text": ("invalid", "not a matrix of numbers"),
    "skips": ("skipped", "odd seeds are not for me"),
}


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    out = tmp_path_factory.mktemp("faults")
    start = time.monotonic()
    rows, _ = run_here(out, method=[",".join([*EXPECTED, "good"])], limit=PROBLEMS, timeout=3.0, memory=0.3)
    by_method = defaultdict(list)
    for row in rows:
        by_method[row["method"]].append(row)
    return out, by_method, time.monotonic() - start


@pytest.mark.parametrize("method", EXPECTED)
def test_a_fault_costs_its_own_trials_alone(outcome, method):
    _, by_method, _ = outcome
    status, words = EXPECTED[method]
    odd = {row["problem"] for row in by_method["raises"] if row["status"] == "error"}
    assert 0 < len(odd) < PROBLEMS, "the seeds of the first problems must be of both kinds"
    assert sorted(row["problem"] for row in by_method[method]) == list(range(PROBLEMS))
    for row in by_method[method]:
        if row["problem"] in odd:
            assert row["status"] == status, row
            assert words is None or words in row["error"], row
        else:
            assert row["status"] == "ok", row
        assert (row["T_target_source"] is not None) == (row["status"] == "ok")


def test_the_method_beside_them_is_untouched(outcome):
    _, by_method, _ = outcome
    assert [row["status"] for row in by_method["good"]] == ["ok"] * PROBLEMS


def test_time_of_a_timed_out_trial_is_kept(outcome):
    _, by_method, _ = outcome
    times = [row["time_ms"] for row in by_method["sleeps"] if row["status"] == "timeout"]
    assert all(3000 <= time_ms < 6000 for time_ms in times)


def test_megabytes_of_output_are_cut_in_the_log(outcome):
    out, _, _ = outcome
    log = Path(out) / "logs" / "prints.log"
    assert 10_000_000 <= log.stat().st_size < 10_100_000
    assert log.read_bytes().endswith(b"the rest is dropped]\n")


def test_the_traceback_is_in_the_log(outcome):
    out, _, _ = outcome
    assert "RuntimeError: on" in (Path(out) / "logs" / "raises.log").read_text()


def test_no_process_is_left(outcome):
    left = [child for child in psutil.Process().children(recursive=True) if "regbench" in " ".join(child.cmdline())]
    orphans = [
        process
        for process in psutil.process_iter(["cmdline", "ppid"])
        if "regbench.runner.worker" in " ".join(process.info["cmdline"] or []) and process.info["ppid"] == 1
    ]
    assert not left
    assert not orphans


@pytest.mark.parametrize(
    ("method", "status", "words"),
    [
        ("needs", "missing", "pip install a-package-that-nobody-has"),
        ("fails_to_prepare", "error", "while it prepared: FileNotFoundError: weights.safetensors"),
        ("dies_while_preparing", "crashed", "SIGSEGV"),
    ],
)
def test_a_method_that_cannot_start_has_a_row_for_every_trial(tmp_path, method, status, words):
    rows, _ = run_here(tmp_path, method=[f"{method},good"], limit=3)
    failed = [row for row in rows if row["method"] == method]
    assert [row["status"] for row in failed] == [status] * 3
    assert all(words in row["error"] for row in failed)
    assert sum(row["status"] == "ok" for row in rows) == 3


def test_missing_trials_run_again_once_the_package_is_there(tmp_path):
    run_here(tmp_path, method=["needs"], limit=2)
    _, progress = run_here(tmp_path, method=["needs"], limit=2)
    assert progress.done == 0


def test_what_ran_out_of_time_runs_again_with_more_and_not_with_the_same(tmp_path):
    rows, _ = run_here(tmp_path, method=["sleeps"], limit=2, timeout=0.3)
    assert "timeout" in {row["status"] for row in rows}
    late = sum(row["status"] == "timeout" for row in rows)
    _, same = run_here(tmp_path, method=["sleeps"], limit=2, timeout=0.3)
    assert same.done == 2
    _, more = run_here(tmp_path, method=["sleeps"], limit=2, timeout=0.4)
    assert more.done == 2 - late
