"""The journal: what is in it can be trusted, whatever happened while it was written."""

import json
import resource
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regbench.errors import UserError
from regbench.runner.journal import Journal, read_rows
from tests.runner.helpers import FAULTY, rows_of, run_here


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=16, max_size=16))
@settings(max_examples=200)
def test_a_transform_comes_back_bit_for_bit(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("journal") / "trials.jsonl"
    T = np.array(values).reshape(4, 4)
    with Journal(path) as journal:
        journal.append({"key": "k", "T_target_source": T.tolist()})
    back = np.array(read_rows(path)[0]["T_target_source"])
    assert back.tobytes() == T.tobytes()


@pytest.mark.parametrize("cut", [1, 5, 20])
def test_a_torn_last_line_is_cut_and_runs_again(tmp_path, cut):
    rows, _ = run_here(tmp_path, method=["good"], limit=4)
    path = tmp_path / "trials.jsonl"
    path.write_bytes(path.read_bytes()[:-cut])
    again, progress = run_here(tmp_path, method=["good"], limit=4)
    assert "a torn last line" in progress.notes[0]
    assert progress.done == 3
    assert [row["key"] for row in again] == [row["key"] for row in rows]


def test_damage_before_the_last_line_is_an_error_that_names_the_line(tmp_path):
    run_here(tmp_path, method=["good"], limit=3)
    path = tmp_path / "trials.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + b'{"key": 1, "broken\n' + lines[2])
    with pytest.raises(UserError, match=r"trials\.jsonl: line 2 is not a trial"):
        read_rows(path)


def test_two_runs_cannot_write_the_same_journal(tmp_path):
    path = tmp_path / "trials.jsonl"
    with Journal(path), pytest.raises(UserError, match="another run is writing to it"):
        Journal(path)


def test_a_full_disk_is_a_clear_error_and_the_run_continues_later(tmp_path):
    """RLIMIT_FSIZE makes writes fail as a full disk does; the file may not grow beyond a few rows."""
    out = tmp_path / "run"
    command = [sys.executable, "-m", "regbench", "run", "--plugin", str(FAULTY), "--method", "good", "--limit", "60"]

    def little_room():
        resource.setrlimit(resource.RLIMIT_FSIZE, (33_000, 33_000))

    first = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True, preexec_fn=little_room)
    assert first.returncode == 2
    assert "trials.jsonl: cannot be written" in first.stderr
    assert "it continues" in first.stderr
    assert "Traceback" not in first.stderr
    kept = rows_of(out)
    assert 0 < len(kept) < 60
    second = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True)
    assert second.returncode == 0, second.stderr
    rows = rows_of(out)
    assert rows[: len(kept)] == kept
    assert len({row["key"] for row in rows}) == len(rows) == 60


def test_a_row_that_is_not_a_number_is_refused(tmp_path):
    with Journal(tmp_path / "trials.jsonl") as journal, pytest.raises(ValueError, match="not JSON compliant"):
        journal.append({"key": "k", "time_ms": float("nan")})
    assert (tmp_path / "trials.jsonl").read_bytes() == b""


def test_rows_have_what_a_reader_needs(tmp_path):
    rows, _ = run_here(tmp_path, method=["good"], limit=1)
    needed = {"method", "protocol", "problem", "repeat", "status", "T_target_source", "time_ms", "cpu_ms", "error"}
    assert needed <= set(rows[0])
    assert json.loads((tmp_path / "manifest.json").read_text())["finished"]
