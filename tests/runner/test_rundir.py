"""The folder of a run: what stands in the way is said in words, and nothing is lost or mixed."""

import json
import signal
import subprocess
import sys
import threading

import psutil
import pytest

from regbench.errors import UserError
from regbench.runner import rundir
from regbench.runner.journal import Journal
from regbench.runner.rundir import RunDir
from tests.runner.helpers import FAULTY, regbench, rows_of, run_here, wait_until


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("rundir") / "run"
    run_here(out, method=["good"], limit=2)
    return out


@pytest.fixture
def folder(finished, tmp_path):
    """Return a copy of a finished run, moved elsewhere."""
    copy = tmp_path / "copy"
    subprocess.run(["cp", "-r", str(finished), str(copy)], check=True)
    return copy


def test_a_copy_elsewhere_continues(folder):
    _, progress = run_here(folder, method=["good"], limit=2)
    assert (progress.total, progress.done) == (2, 2)


def test_fresh_is_refused_while_another_run_writes(folder):
    with Journal(folder / "trials.jsonl"), pytest.raises(UserError, match="another run is writing to it"):
        rundir.make(RunDir(folder), fresh=True)
    assert len(rows_of(folder)) == 2


def test_fresh_twice_keeps_both(folder):
    for _ in range(2):
        rundir.make(RunDir(folder), fresh=True)
        (folder / "trials.jsonl").write_text("")
    assert len(list(folder.glob("trials.before-*.jsonl"))) == 2


def test_a_run_killed_at_its_start_leaves_a_usable_folder(tmp_path):
    for _ in range(2):
        rundir.make(RunDir(tmp_path / "run"), fresh=False)


@pytest.mark.parametrize("content", ["{}", "[]", "{", '{"config": 3}'])
def test_a_damaged_manifest_is_named(folder, content):
    (folder / "manifest.json").write_text(content)
    with pytest.raises(UserError, match=r"manifest\.json: is not a run's manifest .*--fresh"):
        run_here(folder, method=["good"], limit=2)
    assert (folder / "manifest.json").read_text() == content


def test_damaged_truths_are_written_anew(folder):
    whole = (folder / "problems.jsonl").read_bytes()
    (folder / "problems.jsonl").write_bytes(b'\xff{"protocol": 3\n' + whole.splitlines()[1] + b"\n{}\n")
    run_here(folder, method=["good"], limit=2)
    assert sorted((folder / "problems.jsonl").read_bytes().splitlines()) == sorted(whole.splitlines())


def test_too_long_a_name_is_said(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match="cannot be made"):
        run_here("x" * 300, method=["good"], limit=1)
    with pytest.raises(UserError, match="is not a run"):
        rundir.find_run(tmp_path / ("x" * 300))


@pytest.mark.parametrize("what", ["runs is a file", "latest is a folder"])
def test_a_run_without_a_latest_is_still_a_run(tmp_path, monkeypatch, what):
    monkeypatch.chdir(tmp_path)
    if what == "runs is a file":
        (tmp_path / "runs").touch()
    else:
        (tmp_path / "runs" / "latest").mkdir(parents=True)
    rows, progress = run_here(tmp_path / "out", method=["good"], limit=1)
    assert [row["status"] for row in rows] == ["ok"]
    assert [note.split(" is left")[0] for note in progress.notes] == ["runs/latest"]
    assert not list(tmp_path.glob("runs/.latest*"))


def test_latest_survives_many_runs_at_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = "from pathlib import Path; from regbench.runner.rundir import *\n"
    code += "for _ in range(300): assert point_latest(RunDir(Path())) is None"
    processes = [subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE) for _ in range(2)]
    assert [process.communicate()[1] for process in processes] == [b"", b""]


def test_too_many_jobs_are_refused_before_anything_is_written(tmp_path):
    with pytest.raises(UserError, match="needs 1000 cores"):
        run_here(tmp_path / "run", method=["good"], jobs=1000)
    assert not (tmp_path / "run").exists()


def grandchildren(pid):
    """Return what workers have started."""
    children = [child.pid for child in psutil.Process(pid).children()]
    return [process for process in psutil.process_iter() if parent_of(process) in children]


def parent_of(process):
    try:
        return process.ppid()
    except psutil.NoSuchProcess:
        return None


def lives(process):
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_polite_stop_leaves_no_process(tmp_path, number):
    """What a worker has started goes with it: death with the parent would reach the worker alone."""
    command = [sys.executable, "-m", "regbench", "run", "--plugin", str(FAULTY), "--method", "good,spins"]
    command += ["--out", str(tmp_path / "run")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: grandchildren(process.pid))
    below = grandchildren(process.pid)
    process.send_signal(number)
    _, stderr = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "interrupted; give the same command again to continue" in stderr
    wait_until(lambda: not any(map(lives, below)), seconds=5)
    for line in (tmp_path / "run" / "trials.jsonl").read_text().splitlines():
        json.loads(line)


def test_two_runs_at_the_same_moment(tmp_path):
    """One of them runs; the other is told so, or finds it all done."""
    answers = []
    command = ("run", "--plugin", FAULTY, "-m", "good", "--limit", 30, "--out", tmp_path / "run")
    threads = [threading.Thread(target=lambda: answers.append(regbench(*command))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(answer.returncode for answer in answers) in ([0, 0], [0, 2])
    assert all("another run is writing" in answer.stderr for answer in answers if answer.returncode == 2)
    rows = rows_of(tmp_path / "run")
    assert len(rows) == len({row["key"] for row in rows}) == 30
