"""regbench reproduce RUN: every trial again, and whether its transform is the same 64 bits."""

import json
import re
import shutil
from pathlib import Path

import pytest

from regbench.cli.main import main
from regbench.runner.journal import read_rows

FAULTY = Path(__file__).parents[1] / "runner" / "faulty_methods.py"
REGISTERS = """
import os, numpy as np
from regbench import Registration
class Drifts:
    name = "drifts"
    def register(self, problem):
        T = np.eye(4)
        T[0, 3] = np.random.default_rng().random()
        return Registration(T_target_source=T)
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run with seeds, repeats, failures, and methods that did not all run on as many problems."""
    folder = tmp_path_factory.mktemp("replay")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        fixed = ["--seed", "3", "--repeat", "2", "--plugin", str(FAULTY), "--out", "runs/first"]
        assert main(["run", "-m", "icp,raises", "--limit", "5", *fixed]) == 0
        assert main(["run", "-m", "ransac", "--limit", "2", *fixed]) == 0
    return folder / "runs" / "first"


@pytest.fixture
def here(finished, tmp_path, monkeypatch):
    """A copy of the run, in the current folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(finished, "runs/first")
    return tmp_path


def changed(change):
    """Change the row of icp on problem 4, repeat 1, of the run."""
    journal = Path("runs/first/trials.jsonl")
    rows = read_rows(journal)
    for row in rows:
        if (row["method"], row["problem"], row["repeat"]) == ("icp", 4, 1):
            change(row)
    journal.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_a_run_is_repeated_bit_for_bit(here, capsys):
    assert main(["reproduce", "first"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert set(said[:-1]) == {
        "icp on demo@1: 10 of 10 trials the same",
        "raises on demo@1: 10 of 10 trials the same",
        "ransac on demo@1: 4 of 4 trials the same",
    }
    assert said[-1] == "the same: every transform, bit for bit"

    def answers(run):
        rows = read_rows(Path(run) / "trials.jsonl")
        return {(row["method"], row["problem"], row["repeat"]): row["T_target_source"] for row in rows}

    assert answers("runs/first-again") == answers("runs/first")


def test_one_bit_is_a_difference(here, capsys):
    def one_bit(row):
        entry = row["T_target_source"][1][3]
        row["T_target_source"][1][3] = float.fromhex(float.hex(entry)) + 2.0**-52

    changed(one_bit)
    assert main(["reproduce", "runs/first", "--out", "again"]) == 1
    said = capsys.readouterr().out
    assert "icp on demo@1: 9 of 10 trials the same" in said
    assert re.search(r"another transform, by up to 0 deg and 2\.2e-16: problem 4 repeat 1\n", said)
    assert said.endswith("NOT the same: 1 of 3 rows of the table differ\n")


def test_another_status_is_a_difference(here, capsys):
    changed(lambda row: row.update(status="timeout", T_target_source=None))
    assert main(["reproduce", "runs/first", "--out", "again"]) == 1
    assert "ended otherwise: problem 4 repeat 1 timeout -> ok" in capsys.readouterr().out


def test_limit_takes_the_first_problems_alone(here, capsys):
    changed(lambda row: row.update(status="timeout", T_target_source=None))
    assert main(["reproduce", "runs/first", "--out", "again", "--limit", "1"]) == 0
    assert "icp on demo@1: 2 of 2 trials the same" in capsys.readouterr().out


def test_the_same_command_continues(here, capsys):
    assert main(["reproduce", "runs/first", "--limit", "1"]) == 0
    assert main(["reproduce", "runs/first"]) == 0
    capsys.readouterr()
    assert main(["reproduce", "runs/first"]) == 0
    assert len(read_rows(Path("runs/first-again/trials.jsonl"))) == 24, "none twice"


def test_a_run_of_a_cluster_is_repeated_here(here, capsys):
    manifest = Path("runs/first/manifest.json")
    content = json.loads(manifest.read_text())
    content["config"] |= {"executor": "dask", "scheduler": "tcp://gone:8786"}
    manifest.write_text(json.dumps(content))
    assert main(["reproduce", "first", "--limit", "1"]) == 0
    assert "the same: every transform, bit for bit" in capsys.readouterr().out


def test_a_method_that_draws_anew_is_found_out(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("drifts.py").write_text(REGISTERS)
    assert main(["run", "-m", "drifts", "--plugin", "drifts.py", "--limit", "3", "--out", "runs/drifts"]) == 0
    assert main(["reproduce", "drifts"]) == 1
    assert "drifts on demo@1: 0 of 3 trials the same" in capsys.readouterr().out


def test_a_changed_method_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(REGISTERS)
    assert main(["run", "-m", "drifts", "--plugin", "mine.py", "--limit", "1", "--out", "runs/mine"]) == 0
    manifest = json.loads(Path("runs/mine/manifest.json").read_text())
    for row in manifest["methods"]:
        row["fingerprint"] = "0" * 64
    Path("runs/mine/manifest.json").write_text(json.dumps(manifest))
    journal = Path("runs/mine/trials.jsonl")
    rows = [{**row, "fingerprint": "0" * 64} for row in read_rows(journal)]
    journal.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert main(["reproduce", "mine"]) == 1
    assert "the method's source, parameters or weights have changed since" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["runs/first", "--out", "runs/first"], "is the run itself; give another --out"),
        (["runs/gone"], "runs/gone: is not a run"),
        (["firts"], "unknown experiment 'firts'"),
        (["runs/first", "--steps", "3"], "--steps goes with an experiment"),
        (["runs/first", "--set", "training.batch=1"], "--set goes with an experiment"),
        (["latentcem-ablations", "--jobs", "2"], "trains and measures one after the other"),
        (["runs/first", "--jobs", "1000"], "needs 1000 cores"),
    ],
)
def test_bad_input_is_one_line(here, capsys, arguments, words):
    assert main(["reproduce", *arguments]) == 2
    said = capsys.readouterr().err
    assert re.fullmatch(r"regbench: [^\n]*\n", said)
    assert words in said


@pytest.mark.parametrize("config", [None, [], {"method": ["icp"], "seed": -1}, {"cores": 3}])
def test_a_damaged_manifest_is_one_line(here, capsys, config):
    path = Path("runs/first/manifest.json")
    path.write_text(json.dumps({**json.loads(path.read_text()), "config": config}))
    assert main(["reproduce", "runs/first"]) == 2
    assert re.fullmatch(r"regbench: [^\n]*\n", capsys.readouterr().err)
