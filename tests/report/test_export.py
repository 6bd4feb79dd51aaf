"""Trials in other tools' formats: every row, and numbers that come back bit for bit."""

import csv
import json
import sys

import numpy as np
import pytest

from regbench.cli.main import main
from regbench.report.rundata import read_run
from regbench.report.trial_records import trial_records
from tests.report.helpers import method, motion, protocol, row, write_run

TRUTHS = [motion((10, 0, 0), (0.1, 0.2, 0.3)), motion((20, 0, 0)), None]


@pytest.fixture
def folder(tmp_path):
    """A run of two methods and two repeats; icp fails once, and the third problem's truth is unknown."""
    p, icp, fgr = protocol("demo@1", TRUTHS), method("icp"), method("fgr[a=1,b='x,y']")
    rng = np.random.default_rng(0)
    rows = [
        row(m, p, problem, motion(rng.uniform(-30, 30, 3), rng.normal(size=3)), repeat=repeat, time_ms=rng.uniform())
        for m in (icp, fgr)
        for problem in range(3)
        for repeat in range(2)
    ]
    rows[0] = row(icp, p, 0, status="crashed")
    rows.append(row(method("icp", version="old"), p, 1, motion(), time_ms=1.0))  # stale
    return write_run(tmp_path / "run", [icp, fgr], [p], rows, repeat=2)


def export(folder, tmp_path, format, *options):
    out = tmp_path / f"trials.{format}"
    assert main(["export", str(folder), "--format", format, "--out", str(out), *options]) == 0
    return out


def test_records_have_every_trial_with_its_errors(folder):
    records = list(trial_records([folder]))
    assert len(records) == 12
    failed = records[0]
    assert (failed["status"], failed["T_target_source"], failed["time_ms"]) == ("crashed", None, None)
    # Scored as the identity, as in tables.
    assert failed["rotation_error_deg"] == pytest.approx(10)
    assert failed["translation_error"] == pytest.approx(np.linalg.norm((0.1, 0.2, 0.3)))
    unknown = [record for record in records if record["problem"] == 2]
    assert len(unknown) == 4
    assert {record["rotation_error_deg"] for record in unknown} == {None}
    for record in records[1:4]:
        truth, T = TRUTHS[record["problem"]], np.array(record["T_target_source"])
        cosine = (np.trace(truth[:3, :3].T @ T[:3, :3]) - 1) / 2
        assert record["rotation_error_deg"] == pytest.approx(np.degrees(np.arccos(cosine)))


@pytest.mark.parametrize("format", ["csv", "json", "parquet"])
def test_numbers_come_back_bit_for_bit(folder, tmp_path, format):
    path = export(folder, tmp_path, format)
    if format == "csv":
        rows = list(csv.DictReader(path.open()))
    elif format == "json":
        rows = json.loads(path.read_text())
    else:
        import pyarrow.parquet

        rows = pyarrow.parquet.read_table(path).to_pylist()
    groups = {group.method.method: group for group in read_run(folder).groups}
    assert len(rows) == 12
    for found in rows:
        trial = groups[found["method"]].trials[int(found["problem"]), int(found["repeat"])]
        assert found["status"] == trial.status
        entries = (
            found["T_target_source"] if format == "json" else [found[f"T_{i}{j}"] for i in range(4) for j in range(4)]
        )
        if trial.status != "ok":
            assert entries in (None, [None] * 16, [""] * 16)
            continue
        assert np.array_equal(np.array(entries, dtype=float).reshape(4, 4), trial.T_target_source)
        assert float(found["time_ms"]) == trial.time_ms


def test_two_runs_stand_one_after_the_other(folder, tmp_path):
    path = tmp_path / "both.json"
    assert main(["export", str(folder), str(folder), "--format", "json", "--method", "icp", "-o", str(path)]) == 0
    assert [record["run"] for record in json.loads(path.read_text())] == [str(folder)] * 12


def test_bop_has_its_columns_and_units(folder, tmp_path, capsys):
    lines = export(folder, tmp_path, "bop", "--method", "icp").read_text().splitlines()
    assert lines[0] == "scene_id,im_id,obj_id,score,R,t,time"
    assert [line.split(",")[:4] for line in lines[1:]] == [["1", "1", "1", "1"], ["1", "2", "1", "1"]]
    trial = read_run(folder).groups[0].trials[1, 0]
    R, t, time_s = lines[1].split(",")[4:]
    T = np.array(trial.T_target_source)
    assert np.array_equal(np.array(R.split(), dtype=float).reshape(3, 3), T[:3, :3])
    assert np.allclose(np.array(t.split(), dtype=float), 1000 * T[:3, 3], rtol=1e-15)
    assert float(time_s) == trial.time_ms / 1000
    assert "trials.bop: 2 trials of 6; it has no row for those that failed, nor for repeats" in capsys.readouterr().out
    assert main(["export", str(folder), "--format", "bop", "-o", str(tmp_path / "x")]) == 2
    assert "choose by --method one of fgr" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_without_pyarrow_the_extra_is_named(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["export", str(folder), "--format", "parquet", "-o", str(tmp_path / "x")]) == 2
    assert 'pip install "regbench[parquet]"' in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_a_place_that_cannot_be_written_is_one_line(folder, tmp_path, capsys):
    assert main(["export", str(folder), "-o", str(tmp_path / "none" / "x.csv")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
