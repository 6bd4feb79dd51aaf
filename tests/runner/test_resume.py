"""A run that was killed continues with the same command: the same rows as an undisturbed run, none twice, none lost."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.runner.helpers import FAULTY, SLOW, regbench, rows_of, run_here, wait_until


def answers(rows):
    return {(row["method"], row["problem"], row["repeat"]): row["T_target_source"] for row in rows}


@pytest.mark.parametrize("rounds", [4])
def test_kill_9_in_the_middle(tmp_path, rounds):
    plugin = tmp_path / "slow.py"
    plugin.write_text(SLOW)
    arguments = ["run", "--plugin", plugin, "--method", "slow,identity", "--limit", "40", "--repeat", "2"]
    command = [sys.executable, "-m", "regbench", *map(str, arguments), "--out", str(tmp_path / "killed")]
    journal = tmp_path / "killed" / "trials.jsonl"
    for _ in range(rounds):
        before = len(journal.read_bytes().splitlines()) if journal.exists() else 0
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_until(lambda n=before: journal.exists() and len(journal.read_bytes().splitlines()) >= n + 15)
        process.send_signal(signal.SIGKILL)
        process.wait()
    interrupted = len(rows_of(tmp_path / "killed"))
    assert interrupted < 160, "the run must have been killed before its end for this test to say anything"
    last = regbench(*arguments, "--out", tmp_path / "killed")
    assert last.returncode == 0, last.stderr
    undisturbed = regbench(*arguments, "--out", tmp_path / "undisturbed")
    assert undisturbed.returncode == 0, undisturbed.stderr
    rows = rows_of(tmp_path / "killed")
    assert len(rows) == len({row["key"] for row in rows}) == 160
    assert {row["status"] for row in rows} == {"ok"}
    assert answers(rows) == answers(rows_of(tmp_path / "undisturbed"))


def test_no_worker_outlives_a_killed_run(tmp_path):
    command = [sys.executable, "-m", "regbench", "run", "--plugin", str(FAULTY), "--method", "sleeps"]
    process = subprocess.Popen([*command, "--out", str(tmp_path / "run")], stderr=subprocess.DEVNULL)
    wait_until(lambda: worker_pids(process.pid))
    workers = worker_pids(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), seconds=10)


def worker_pids(parent):
    children = Path(f"/proc/{parent}/task/{parent}/children").parent.parent.glob("*/children")
    return [int(pid) for path in children for pid in path.read_text().split()]


def test_ctrl_c_says_how_to_go_on_and_loses_nothing(tmp_path):
    command = [sys.executable, "-m", "regbench", "run", "--plugin", str(FAULTY), "--method", "good,sleeps"]
    command += ["--out", str(tmp_path / "run")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    journal = tmp_path / "run" / "trials.jsonl"
    wait_until(lambda: journal.exists() and journal.stat().st_size > 0)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "interrupted; give the same command again to continue" in stderr
    assert "Traceback" not in stderr
    rows = rows_of(tmp_path / "run")
    assert {row["status"] for row in rows} == {"ok"}


def test_the_same_command_does_nothing_more(tmp_path):
    rows, _ = run_here(tmp_path, method=["good"], limit=5)
    again, progress = run_here(tmp_path, method=["good"], limit=5)
    assert again == rows
    assert (progress.total, progress.done) == (5, 5)


def test_a_changed_method_runs_again(tmp_path):
    plugin = tmp_path / "slow.py"
    plugin.write_text(SLOW)
    options = {"method": ["slow"], "limit": 3, "plugin": [str(plugin)]}
    command = ["run", "--plugin", plugin, "--method", "slow", "--limit", 3, "--out", tmp_path / "run"]
    assert regbench(*command).returncode == 0
    plugin.write_text(SLOW.replace("0.03", "0.01"))
    assert regbench(*command).returncode == 0
    rows = rows_of(tmp_path / "run")
    assert len(rows) == 6
    assert len({row["fingerprint"] for row in rows}) == 2
    table = json.loads(regbench("table", tmp_path / "run", "--format", "json").stdout)
    assert [entry["n"] for entry in table] == [3], options


def test_fresh_sets_the_old_rows_aside(tmp_path):
    run_here(tmp_path, method=["good"], limit=3)
    _, progress = run_here(tmp_path, method=["good"], limit=3, fresh=True)
    assert progress.done == 0
    assert len(list(tmp_path.glob("trials.before-*.jsonl"))) == 1


def test_a_folder_with_other_things_in_it_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    answer = regbench("run", "--method", "identity", "--limit", 1, "--out", tmp_path)
    assert answer.returncode == 2
    assert "is not empty and not a run" in answer.stderr


def test_another_seed_in_the_same_folder_is_refused(tmp_path):
    run_here(tmp_path, method=["good"], limit=1)
    answer = regbench("run", "--method", "identity", "--limit", 1, "--seed", 1, "--out", tmp_path)
    assert answer.returncode == 2
    assert "holds a run with --seed 0" in answer.stderr
    assert len(rows_of(tmp_path)) == 1
