"""The paper's figures: complete, and the cells that cannot hold are found by the bound."""

import csv
import math
from importlib.resources import files

import pytest

from regbench.report.published import PAIRS, published_rows


def marked(column_group):
    return {row["method"]: row["impossible"] for row in published_rows(column_group, "p@1") if row["impossible"]}


def test_every_cell_of_the_paper_is_there_digit_for_digit():
    path = files("regbench.report") / "paper_table1.csv"
    cells = list(csv.DictReader(path.read_text().splitlines()))
    assert len(cells) == 27
    for group in PAIRS:
        rows = published_rows(group, "p@1")
        expected = [cell for cell in cells if cell["dataset"] == group]
        assert [row["method"] for row in rows] == [f"{cell['method']} (paper)" for cell in expected]
        for row, cell in zip(rows, expected, strict=True):
            for key in ("rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t"):
                assert row["printed"][key] == cell[key]
                assert row[key] == float(cell[key])


def test_the_cells_that_cannot_hold():
    assert marked("modelnet40_same") == marked("modelnet40_noise") == {}
    assert marked("7scene") == {
        "PointNetLK (paper)": ["mae_t", "rmse_t"],
        "LatentCEM (paper)": ["mae_r_deg", "mae_t", "rmse_r_deg", "rmse_t"],
    }


@pytest.mark.parametrize("group", PAIRS)
def test_exactly_the_ratios_over_the_bound_are_marked(group):
    for row in published_rows(group, "p@1"):
        for rmse_key, mae_key in (("rmse_r_deg", "mae_r_deg"), ("rmse_t", "mae_t")):
            over = row[rmse_key] / row[mae_key] > math.sqrt(3 * PAIRS[group])
            assert (rmse_key in row["impossible"]) == (mae_key in row["impossible"]) == over


def test_the_reasons_are_given():
    notes = {row["method"]: row["note"] for row in published_rows("7scene", "p@1")}
    assert notes["LatentCEM (paper)"] == (
        "cannot hold: RMSE(R) / MAE(R) = 440 and RMSE(t) / MAE(t) = 750, over 57 pairs at most sqrt(3 * 57) = 13.1"
    )
    assert notes["RPM-Net (paper)"] == "row commented out in the paper's source"
    assert notes["ICP (paper)"] is None


def test_times_stand_where_they_were_measured_and_say_what_they_are():
    times = {row["method"]: row for row in published_rows("modelnet40_same", "p@1")}
    assert times["ICP (paper)"]["time_median_ms"] == 8.168
    assert times["LatentCEM (paper)"]["time_note"] == "mean, GPU RTX 2080 Ti"
    assert all(row["time_median_ms"] is None for row in published_rows("7scene", "p@1"))
