"""What a row of a table has of being compared with the best row of its protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from regbench.metrics.table import Metric
from regbench.report.improvement import improvement_column, improvements
from regbench.report.paired import TrialValues
from regbench.report.rundata import RunData
from regbench.report.significance import worse_than_best


def mark_worse(run: RunData, rows: Sequence[dict[str, Any]], values: Sequence[TrialValues]) -> None:
    """Give every row `worse_than_best`: the corrected p by the metrics in which it is worse than the best row."""
    for places in places_by_protocol(rows):
        marks = worse_than_best(
            [rows[place] for place in places],
            [values[place] for place in places],
            rank_times=len(run.machines) == 1,
        )
        for place, mark in zip(places, marks, strict=True):
            rows[place]["worse_than_best"] = mark


def add_improvements(
    run: RunData, rows: Sequence[dict[str, Any]], values: Sequence[TrialValues], metric: Metric
) -> None:
    """Give every row the share of trials on which it is better in a metric than the best row of its protocol."""
    key, one_machine = improvement_column(metric).key, len(run.machines) == 1
    for places in places_by_protocol(rows):
        shares = improvements(
            [rows[place] for place in places], [values[place] for place in places], metric, rank_times=one_machine
        )
        for place, share in zip(places, shares, strict=True):
            rows[place][key] = share


def places_by_protocol(rows: Sequence[Mapping[str, Any]]) -> list[list[int]]:
    """Return the positions of the rows of each protocol."""
    places: dict[str, list[int]] = {}
    for place, row in enumerate(rows):
        places.setdefault(row["protocol"], []).append(place)
    return list(places.values())
