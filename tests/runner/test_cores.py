"""Cores that lanes claim, also of other runs on this machine."""

import os
import subprocess
import sys
import time

import pytest

from regbench.errors import UserError
from regbench.runner.cores import ClaimedCores
from regbench.runner.dask_lanes import claimed_for_a_lane
from tests.runner.helpers import regbench, rows_of, run_here, wait_until

pytestmark = pytest.mark.usefixtures("own_locks")

USABLE = sorted(os.sched_getaffinity(0), reverse=True)
CLAIM = """
from regbench.runner.cores import ClaimedCores
held = ClaimedCores({})
print(held.cores, flush=True)
input()
"""


def free():
    with ClaimedCores(len(USABLE)) as claimed:
        return claimed.cores


def test_no_core_is_claimed_twice_and_a_death_frees_it():
    with ClaimedCores(1) as first:
        assert first.cores == USABLE[:1]
        assert free() == USABLE[1:]
        with pytest.raises(UserError, match="timed trials never share a core"):
            claimed_for_a_lane(len(USABLE))
        assert free() == USABLE[1:], "what is refused must hold nothing"
    command = [sys.executable, "-c", CLAIM.format(len(USABLE))]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        assert free() == []
        other.kill()
    wait_until(lambda: free() == USABLE or time.sleep(0.05))


def test_a_run_takes_cores_that_no_other_run_holds(tmp_path):
    if len(USABLE) < 2:
        pytest.skip("one core: none is left beside another run")
    with ClaimedCores(1):
        rows, progress = run_here(tmp_path / "run", method=["identity"], limit=2)
    assert {tuple(row["cores"]) for row in rows} == {(USABLE[1],)}
    assert progress.notes == []
    assert free() == USABLE, "a run that ended must hold nothing"


def test_a_run_that_must_share_a_core_says_so_and_goes_on(tmp_path):
    with ClaimedCores(len(USABLE)):
        done = regbench("run", "--method", "identity", "--limit", 2, "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    assert f"another run holds core {USABLE[0]}, this one uses it too" in done.stderr
    assert {(row["status"], *row["cores"]) for row in rows_of(tmp_path / "run")} == {("ok", USABLE[0])}


def test_a_folder_that_cannot_hold_locks_is_one_line(tmp_path):
    (tmp_path / f"regbench-cores-{os.getuid()}").write_text("in the way")
    done = regbench("run", "--method", "identity", "--limit", 2, "--out", tmp_path / "run")
    assert done.returncode == 2
    assert "cores cannot be claimed for timed trials (File exists); set TMPDIR" in done.stderr
    assert "Traceback" not in done.stderr
