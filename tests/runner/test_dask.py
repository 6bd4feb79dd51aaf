"""A dask scheduler and its workers, real processes on loopback: the same rows as on one machine, whatever dies."""

import json
import os
import signal
import subprocess
import sys

import psutil
import pytest
from distributed import Client

from regbench.errors import UserError
from regbench.runner.dask_lanes import Lanes, Work
from regbench.runner.plan import RunConfig
from regbench.runner.run import make_plan
from tests.runner.helpers import SLOW, regbench, rows_of, wait_until

FAULTY = """
import os
import signal

import numpy as np
from regbench import Registration

class Dies:
    name = "dies"
    def register(self, problem):
        if len(str(problem.source[0, 0])) % 2:
            os.kill(os.getpid(), signal.SIGSEGV)
        return Registration(T_target_source=np.eye(4))
"""


pytestmark = pytest.mark.usefixtures("own_locks")
# It kills the dask worker that its process belongs to.
DEADLY = """
import os
import signal

class Deadly:
    name = "deadly"
    def register(self, problem):
        os.kill(os.getppid(), signal.SIGKILL)
"""


@pytest.fixture
def processes():
    """Processes that end with the test."""
    started = []
    yield started
    for process in started:
        process.kill()
        process.wait()


def start(processes, *arguments):
    command = [sys.executable, "-m", "distributed.cli." + arguments[0], *map(str, arguments[1:])]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    processes.append(process)
    return process


def start_scheduler(processes, folder, port=0):
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    process = start(
        processes, "dask_scheduler", "--host", "127.0.0.1", "--port", port, "--scheduler-file", file, "--no-dashboard"
    )
    wait_until(lambda: file.exists() and file.read_text().endswith("}"))
    return process, json.loads(file.read_text())["address"]


def start_workers(processes, address, count=2):
    # Without a nanny: what is killed stays dead.
    options = ("--nthreads", 1, "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
    workers = [start(processes, "dask_worker", address, *options) for _ in range(count)]
    with Client(address, set_as_default=False) as client:
        wait_until(lambda: len(client.scheduler_info()["workers"]) >= count)
    return workers


@pytest.fixture
def slow(tmp_path):
    plugin = tmp_path / "slow.py"
    plugin.write_text(SLOW)
    return ["run", "--plugin", plugin, "--method", "slow,icp", "--limit", "60"]


def by_key(folder):
    rows = rows_of(folder)
    assert len(rows) == len({row["key"] for row in rows}), "a trial was written twice"
    assert {row["status"] for row in rows} == {"ok"}
    return {row["key"]: row["T_target_source"] for row in rows}


def running(arguments, out, address):
    command = [sys.executable, "-m", "regbench", *map(str, arguments), "--out", str(out)]
    command += ["--executor", "dask", "--scheduler", address]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def lines(out):
    journal = out / "trials.jsonl"
    return len(journal.read_bytes().splitlines()) if journal.exists() else 0


def test_a_killed_worker_and_a_killed_scheduler_cost_no_row_and_no_bit(tmp_path, processes, slow):
    assert regbench(*slow, "--out", tmp_path / "local").returncode == 0
    scheduler, address = start_scheduler(processes, tmp_path)
    workers = start_workers(processes, address)
    run = running(slow, tmp_path / "dask", address)
    wait_until(lambda: lines(tmp_path / "dask") >= 20)
    workers[0].send_signal(signal.SIGKILL)
    before = lines(tmp_path / "dask")
    wait_until(lambda: lines(tmp_path / "dask") > before or run.poll() is not None)
    assert run.poll() is None, run.stderr.read()
    scheduler.send_signal(signal.SIGKILL)
    _, words = run.communicate(timeout=90)
    assert run.returncode == 2
    assert f"the dask scheduler at {address} is gone" in words
    assert "Traceback" not in words
    assert 20 <= lines(tmp_path / "dask") < 120, "the run must have been stopped in its middle"
    _, address = start_scheduler(processes, tmp_path)
    start_workers(processes, address)
    run = running(slow, tmp_path / "dask", address)
    _, words = run.communicate(timeout=120)
    assert run.returncode == 0, words
    assert by_key(tmp_path / "dask") == by_key(tmp_path / "local")


def test_a_cluster_of_its_own_gives_the_local_rows_each_lane_on_its_own_core(tmp_path, slow):
    jobs = min(2, len(os.sched_getaffinity(0)))
    for executor in ("local", "dask"):
        done = regbench(*slow, "--jobs", jobs, "--executor", executor, "--out", tmp_path / executor)
        assert done.returncode == 0, done.stderr
    assert by_key(tmp_path / "dask") == by_key(tmp_path / "local")
    rows = rows_of(tmp_path / "dask")
    assert len({tuple(row["cores"]) for row in rows}) == jobs
    assert {(row["host"], row["machine"]) for row in rows} == {
        (row["host"], row["machine"]) for row in rows_of(tmp_path / "local")
    }


def test_an_interrupt_ends_a_cluster_of_its_own_and_the_same_command_continues(tmp_path, slow):
    command = [sys.executable, "-m", "regbench", *map(str, slow), "--executor", "dask", "--out", str(tmp_path / "run")]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: lines(tmp_path / "run") >= 20)
    started = children_of(run.pid)
    run.send_signal(signal.SIGINT)
    _, words = run.communicate(timeout=60)
    assert run.returncode == 130
    assert words.splitlines()[-1] == "regbench: interrupted; give the same command again to continue"
    assert "WARNING" not in words
    wait_until(lambda: not any(psutil.pid_exists(pid) for pid in started), seconds=20)
    assert 20 <= lines(tmp_path / "run") < 120
    assert subprocess.run(command, capture_output=True).returncode == 0
    assert len(by_key(tmp_path / "run")) == 120


def children_of(pid):
    return [child.pid for child in psutil.Process(pid).children(recursive=True)]


def run_of_plugin(processes, folder, text, method, *, limit, workers):
    """Run a plugin's method on a scheduler with workers; return these, the exit code and what was said."""
    plugin = folder / "plugin.py"
    plugin.write_text(text)
    _, address = start_scheduler(processes, folder)
    started = start_workers(processes, address, count=workers)
    run = running(["run", "--plugin", plugin, "--method", method, "--limit", limit], folder / "dask", address)
    _, words = run.communicate(timeout=90)
    return started, run.returncode, words


def test_a_crash_of_a_method_kills_neither_a_dask_worker_nor_the_run(tmp_path, processes):
    workers, code, words = run_of_plugin(processes, tmp_path, FAULTY, "dies", limit=12, workers=1)
    assert code == 0, words
    statuses = [row["status"] for row in rows_of(tmp_path / "dask")]
    assert len(statuses) == 12
    assert set(statuses) == {"ok", "crashed"}
    assert workers[0].poll() is None


def test_a_block_under_which_every_dask_worker_dies_ends_the_run_in_one_line(tmp_path, processes, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "1")
    workers, code, words = run_of_plugin(processes, tmp_path, DEADLY, "deadly", limit=2, workers=2)
    assert code == 2, words
    assert "dask gave up on a block of trials: every worker that took it died" in words
    assert "Traceback" not in words
    assert [worker.wait(timeout=10) for worker in workers] == [-signal.SIGKILL] * 2


def test_what_is_not_there_is_said_in_one_line(tmp_path, processes):
    def refused(*arguments):
        done = regbench("run", "--method", "identity", "--limit", 2, "--out", tmp_path / "run", *arguments)
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
        return done.stderr

    assert "no dask scheduler answers there" in refused("--executor", "dask", "--scheduler", "tcp://127.0.0.1:9")
    assert "--executor dask" in refused("--scheduler", "tcp://127.0.0.1:9")
    assert "unknown executor 'daks'; did you mean 'dask'?" in refused("--executor", "daks")
    assert "needs 999 cores" in refused("--executor", "dask", "--jobs", "999")
    _, address = start_scheduler(processes, tmp_path)
    assert f"start some: `dask worker {address}`" in refused("--executor", "dask", "--scheduler", address)


def lanes_of(tmp_path, method="identity", protocol="demo@1", **changes):
    plan, _ = make_plan(RunConfig(method=[method], protocol=[protocol], data=changes.pop("data", None)))
    work = {
        "config": plan.config,
        "fingerprints": [planned.fingerprint for planned in plan.methods],
        "protocols": [planned.identity for planned in plan.protocols],
        "data_dir": plan.data_dir,
        "logs": tmp_path,
    }
    lanes = Lanes("test", Work(**{**work, **changes}))
    lanes.setup(None)
    return lanes


def test_a_machine_without_the_prepared_set_says_so_at_once(tmp_path, prepared_data, monkeypatch):
    monkeypatch.delenv("REGBENCH_DATA", raising=False)
    here = {"protocol": "7scenes/clean@1", "data": str(prepared_data)}
    assert lanes_of(tmp_path, **here).wrong is None
    elsewhere = lanes_of(tmp_path, **here, data_dir=tmp_path / "elsewhere")
    assert "dataset 7scenes is not prepared in" in elsewhere.wrong
    with pytest.raises(UserError, match="is not prepared"):
        elsewhere.rows([])
    monkeypatch.setenv("REGBENCH_DATA", str(prepared_data))
    assert lanes_of(tmp_path, **here, data_dir=tmp_path / "elsewhere").wrong is None


def test_a_machine_with_another_version_of_a_method_says_so_at_once(tmp_path):
    assert lanes_of(tmp_path).wrong is None
    assert "method identity is another here" in lanes_of(tmp_path, fingerprints=["f" * 64]).wrong
