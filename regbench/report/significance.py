"""Which rows of a table are worse than the best one by more than chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from regbench.metrics.paired_tests import holm, signed_rank_p
from regbench.metrics.table import METRICS, Metric
from regbench.report.layout import SIGNIFICANT, figure, is_ranked
from regbench.report.paired import TrialValues, paired_means

Row = Mapping[str, Any]


def worse_than_best(
    rows: Sequence[Row], values: Sequence[TrialValues | None], *, rank_times: bool
) -> list[dict[str, float]]:
    """Return for each row of a protocol the metrics in which it is worse than the best row, with the corrected p.

    Wilcoxon's signed-rank test on the problems of both, one-sided, corrected by Holm over the rows of the column. Rows
    that are not ranked are not tested; one that prints the best's figure is not marked.

    Args:
        rows: As `summarise` and `published_rows` give them.
        values: Of the same rows; None for a published one.
        rank_times: False where the rows were timed on different machines.
    """
    marks: list[dict[str, float]] = [{} for _ in rows]
    ranked = [position for position, row in enumerate(rows) if is_ranked(row) and values[position] is not None]
    for metric in METRICS.values():
        if metric.needs == "times" and not rank_times:
            continue
        there = [position for position in ranked if rows[position].get(metric.key) is not None]
        if len(there) < 2:
            continue
        best = best_of(rows, there, metric)
        others = [position for position in there if figure(rows[position], metric) != figure(rows[best], metric)]
        corrected = holm([_p(values[position], values[best], metric) for position in others])
        for position, p in zip(others, corrected, strict=True):
            if p < SIGNIFICANT:
                marks[position][metric.key] = p
    return marks


def best_of(rows: Sequence[Row], positions: Sequence[int], metric: Metric) -> int:
    """Return which of some rows, one at least, has the best figure; the first of equal ones."""
    return min(positions, key=lambda position: rows[position][metric.key] * (-1 if metric.higher_is_better else 1))


def _p(suspect: TrialValues | None, best: TrialValues | None, metric: Metric) -> float:
    if suspect is None or best is None:
        raise ValueError("a published row has no trials")
    worse, better = paired_means(suspect, best, metric)
    return signed_rank_p(worse, better, higher_is_better=metric.higher_is_better)
