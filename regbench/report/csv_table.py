"""Tables as CSV: every figure in full, one column per kind of failure."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from regbench.metrics.table import Metric
from regbench.runner.status import FAILURES, Status


def csv_table(rows: Sequence[Mapping[str, Any]], metrics: Sequence[Metric]) -> str:
    """Return a header and one line per method and protocol; an empty cell is a figure that there is not.

    The last column has the metrics in which a row is worse than the best one (significance.py).
    """
    kinds = [status.value for status in Status if status in FAILURES]
    output = io.StringIO()
    writer = csv.writer(output, lineterminator="\n")
    writer.writerow(
        [
            *("method", "protocol", "n", "planned", "failures"),
            *(f"failures_{kind}" for kind in kinds),
            *(metric.key for metric in metrics),
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
                *(row.get(metric.key) for metric in metrics),
                *(row.get(key) for key in ("kind", "sees_ground_truth", "training", "n_truth", "note")),
                " ".join(row.get("worse_than_best", ())),
            ]
        )
    return output.getvalue().rstrip("\n")
