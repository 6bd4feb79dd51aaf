"""regbench reproduce paper: the parts that it is made of, on few methods, and the whole table's shape."""

import csv
from pathlib import Path

import pytest

from regbench.errors import UserError
from regbench.report.published import published_rows, published_times
from regbench.reproduction.tables import Part, run_part, write_table, write_times
from regbench_latentcem import ablations, paper

PART = Part("demo", {"7scene": "demo@1"}, {"ICP": ("icp",), "LatentCEM": ("degenerate",), "": ("identity",)})


def done(out, limit=2):
    said = []
    folder = run_part(PART, out, data=Path("data"), limit=limit, threads=1, jobs=1, device="cpu", say=said.append)
    return folder, said


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with the run and the tables."""
    out = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(out)
        folder, _ = done(out)
        write_table("table1", "Words.", [PART], [folder], out)
        write_times("times", "Words.", PART, "demo@1", folder, out)
    return out


def test_ours_stand_under_the_papers_rows(finished):
    rows = list(csv.DictReader((finished / "table1.csv").read_text().splitlines()))
    names = [row["method"] for row in rows]
    assert names[:2] == ["ICP (paper)", "icp"]
    assert names[-3:] == ["LatentCEM (paper)", "degenerate", "identity"]
    printed = [name for name in names if name.endswith("(paper)")]
    assert printed == [row["method"] for row in published_rows("7scene", "demo@1")]
    latentcem = rows[-3]
    assert (latentcem["rmse_r_deg"], latentcem["mae_r_deg"]) == ("0.0066", "0.000015"), "digit for digit"
    assert set(latentcem["cannot_hold"].split()) == {"rmse_r_deg", "mae_r_deg", "rmse_t", "mae_t"}
    assert rows[1]["n"] == "2"


def test_cells_that_cannot_hold_are_marked_with_the_reason(finished):
    text = (finished / "table1.md").read_text()
    assert "| **LatentCEM (paper)** | 57 | 0.0066! | 0.0030! | 0.000015! | 0.000004! |" in text
    assert "LatentCEM (paper): cannot hold: RMSE(R) / MAE(R) = 440" in text


def test_times_stand_beside_the_texts(finished):
    lines = (finished / "times.md").read_text().splitlines()
    at = next(number for number, line in enumerate(lines) if line.startswith("| **ICP (paper)** | 8.168 |"))
    assert lines[at + 1].startswith("| icp | ")
    assert sum("(paper)" in line for line in lines) == len(published_times()) == 8


def test_the_same_call_goes_on(finished, monkeypatch):
    monkeypatch.chdir(finished)
    _, said = done(finished, limit=3)
    assert said[0] == f"{finished / 'demo'}: 9 trials, 6 of them done before"


def test_a_row_that_the_paper_has_not_is_an_error(finished):
    part = Part("demo", {"7scene": "demo@1"}, {"ICQ": ("icp",)})
    with pytest.raises(UserError, match="no row 'ICQ'"):
        write_table("other", "", [part], [finished / "demo"], finished)


@pytest.mark.parametrize("part", [paper.MODELNET40, paper.SEVEN_SCENES], ids=lambda part: part.name)
def test_every_row_of_the_paper_has_ours(part):
    for group, protocol in part.protocols.items():
        rows = {row["method"].removesuffix(" (paper)") for row in published_rows(group, protocol)}
        assert rows == set(part.methods) - {""}
        assert all(part.methods[name] for name in rows)


def test_the_whole_is_tables_then_ablations(tmp_path, monkeypatch):
    """What is run and in which order; the runs and trainings themselves are tested where they live."""
    calls = []
    monkeypatch.setattr(
        paper, "run_part", lambda part, out, **given: calls.append((part.name, given)) or out / part.name
    )
    monkeypatch.setattr(paper, "write_table", lambda name, *given: calls.append((name, {})))
    monkeypatch.setattr(paper, "write_times", lambda name, *given: calls.append((name, {})))
    monkeypatch.setattr(ablations, "reproduce", lambda out, **given: calls.append((out.name, given)) or 15)
    options = {"steps": 3, "limit": 2, "weights": None, "changes": [], "device": "auto", "threads": 1, "jobs": 2}
    signal = paper.reproduce(tmp_path / "out", data=Path("data"), **options, progress=None, say=lambda line: None)
    assert signal == 15, "a training that was stopped says so"
    assert [name for name, _ in calls] == ["modelnet40", "7scenes", "table1", "times", "ablations"]
    assert [given["limit"] for name, given in calls if "limit" in given] == [2, 2, 2]
    assert [given["jobs"] for name, given in calls if "jobs" in given] == [2, 2, 1]
