"""Tables as CSV: every figure in full, one column per kind of failure."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from regbench.report.layout import Column
from regbench.runner.status import FAILURES, Status


def csv_table(rows: Sequence[Mapping[str, Any]], metrics: Sequence[Column]) -> str:
    """Return a header and one line per method and protocol; an empty cell is a figure that there is not.

    Where rows have intervals, their ends follow the figure. The last column has the metrics in which a row is worse
    than the best one (significance.py).
    """
    figures = [
        key
        for metric in metrics
        for key in (metric.key, f"{metric.key}_low", f"{metric.key}_high")
        if key == metric.key or any(key in row for row in rows)
    ]
    kinds = [status.value for status in Status if status in FAILURES]
    output = io.StringIO()
    writer = csv.writer(output, lineterminator="\n")
    writer.writerow(
        [
            *("method", "protocol", "n", "planned", "failures"),
            *(f"failures_{kind}" for kind in kinds),
            *figures,
            *("kind", "sees_ground_truth", "training", "n_truth", "note", "worse_than_best"),
        ]
    )
    for row in rows:
        failures = row["failures"]
        counts = [None] * (len(kinds) + 1)
        if failures is not None:
            counts = [sum(failures.values()), *(failures.get(kind, 0) for kind in kinds)]
        writer.writerow(
            [
                *(row[key] for key in ("method", "protocol", "n", "planned")),
                *counts,
                *(row.get(key) for key in figures),
                *(row.get(key) for key in ("kind", "sees_ground_truth", "training", "n_truth", "note")),
                " ".join(row.get("worse_than_best", ())),
            ]
        )
    return output.getvalue().rstrip("\n")
