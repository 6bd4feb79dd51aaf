"""Every format of one small run, letter by letter. Its figures are checked by hand in tests/report/test_summary.py.

After a wanted change, write the new files with REGBENCH_WRITE_GOLDEN=1 and read the difference before committing it.
"""

import os
import re
from pathlib import Path

import pytest

from regbench.report.table import render
from tests.report.helpers import example_run

HERE = Path(__file__).parent
CASES = {
    "table.txt": {"format": "text"},
    "table.md": {"format": "markdown"},
    "table.tex": {"format": "latex"},
    "table.csv": {"format": "csv"},
    "table.json": {"format": "json"},
    **{
        f"intervals.{ending}": {
            "format": format,
            "with_intervals": True,
            "improvement": "rre_mean_deg",
            "metrics": ["rmse_r_deg", "recall_15deg", "time_median_ms"],
            "protocols": ["demo@1"],
        }
        for ending, format in (
            ("txt", "text"),
            ("md", "markdown"),
            ("tex", "latex"),
            ("csv", "csv"),
            ("json", "json"),
        )
    },
    "paper.txt": {"format": "text", "paper": True, "protocols": ["modelnet40/clean@1"]},
    "paper.tex": {"format": "latex", "paper": True},
}


@pytest.mark.parametrize("name", CASES)
def test_table_is_as_it_was(tmp_path, name):
    text = render([example_run(tmp_path)], **CASES[name]) + "\n"
    path = HERE / name
    if os.environ.get("REGBENCH_WRITE_GOLDEN"):
        path.write_text(text, encoding="utf-8")
    if name.endswith((".csv", ".json")):  # full figures: the last bits are the machine's
        assert rounded(text) == rounded(path.read_text(encoding="utf-8"))
    else:
        assert text == path.read_text(encoding="utf-8")


def rounded(text):
    """Replace every number with its value to nine digits, so that 0 and a rounding error near it are the same."""
    return re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda number: f"{round(float(number[0]), 9):.9g}", text)
