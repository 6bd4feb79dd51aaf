"""What commands write: never over a run's own files, never over a device, and one line where they cannot."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from regbench.cli.main import main
from tests.report.helpers import example_run

WRITERS = (["table"], ["report"], ["export"], ["plot", "ecdf"])


@pytest.fixture
def run(tmp_path):
    return example_run(tmp_path / "run")


def written(arguments, run, out):
    return main([*arguments, str(run), "--out", str(out)])


@pytest.mark.parametrize("arguments", [*WRITERS, ["compare", "--anyway"]])
def test_what_cannot_be_written_is_one_line(run, tmp_path, capsys, arguments):
    (tmp_path / "file").write_text("in the way")
    runs = [str(run)] * (2 if arguments[0] == "compare" else 1)
    for out in (tmp_path / "file" / "x.pdf", tmp_path / ("x" * 300 + ".pdf"), tmp_path / "no folder" / "x.pdf", ""):
        if arguments[0] == "plot" and out == "":
            continue
        assert main([*arguments, *runs, "--out", str(out)]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "cannot be written" in said or "is not the name of a file" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "run"]


@pytest.mark.parametrize("name", ["trials.jsonl", "problems.jsonl", "manifest.json"])
@pytest.mark.parametrize("arguments", [["table"], ["report"], ["export"]])
def test_a_run_s_own_files_are_not_written_over(run, tmp_path, capsys, arguments, name):
    before = (run / name).read_bytes()
    (tmp_path / "link").symlink_to(run / name)
    for out in (run / name, run / "tables" / ".." / name, tmp_path / "link"):
        assert written(arguments, run, out) == 2
        assert "is a run's own file" in capsys.readouterr().err
    assert (run / name).read_bytes() == before


def test_a_link_stays_one_and_its_file_is_written(run, tmp_path):
    (tmp_path / "target.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to(tmp_path / "target.csv")
    assert written(["export"], run, tmp_path / "link.csv") == 0
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "target.csv").read_text().startswith("run,")


def test_a_pipe_is_written_and_not_replaced(run, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with subprocess.Popen(["cat", tmp_path / "pipe"], stdout=subprocess.PIPE, text=True) as reader:
        try:
            assert written(["table"], run, tmp_path / "pipe") == 0
            assert (tmp_path / "pipe").is_fifo()
            assert "demo@1" in reader.communicate(timeout=20)[0]
        finally:
            reader.kill()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_behind_stdout_is_one_line(run):
    with Path("/dev/full").open("w") as full:
        answer = subprocess.run(
            [sys.executable, "-m", "regbench", "table", str(run)], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert answer.returncode == 2
    assert answer.stderr == "regbench: standard output: cannot be written (No space left on device)\n"
