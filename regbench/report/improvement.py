"""How often each row of a table is better than the best one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from regbench.metrics.paired_tests import probability_of_improvement
from regbench.metrics.table import Metric
from regbench.report.layout import Extra, is_ranked
from regbench.report.paired import TrialValues, paired_values
from regbench.report.significance import best_of

DECIMALS = 3


def improvement_column(metric: Metric) -> Extra:
    """Return the column of a metric."""
    return Extra(
        f"improvement_{metric.key}",
        "P(better)",
        metric.name,
        DECIMALS,
        f"P(better): share of trials on which a row is better in {metric.name} than the best row of that metric, "
        "equal ones counted half.",
    )


def improvements(
    rows: Sequence[Mapping[str, Any]], values: Sequence[TrialValues], metric: Metric, *, rank_times: bool
) -> list[float | None]:
    """Return for each row of a protocol the share of trials on which it is better than the best row, ties half.

    The best is the ranked row with the best figure; it has 0.5 itself, being equal everywhere. None where there is no
    best, or no trial that both have.

    Args:
        rows: As `summarise` gives them.
        values: Of the same rows.
        metric: What is compared, trial by trial.
        rank_times: False where the rows were timed on different machines.
    """
    there = [i for i, row in enumerate(rows) if is_ranked(row) and row.get(metric.key) is not None]
    if not there or (metric.needs == "times" and not rank_times):
        return [None] * len(rows)
    best = values[best_of(rows, there, metric)]
    shares = [
        probability_of_improvement(*paired_values(best, own, metric), higher_is_better=metric.higher_is_better)
        for own in values
    ]
    return [None if math.isnan(share) else share for share in shares]
