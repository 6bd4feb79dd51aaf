"""How sure each figure of a table is: an interval beside it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from regbench.metrics.bootstrap import figure_intervals
from regbench.metrics.table import Metric
from regbench.report.paired import TrialValues

# Every row is drawn from the same seed: a table of the same trials is the same table.
SEED = 0


def intervals(trials: TrialValues, metrics: Iterable[Metric]) -> dict[str, float]:
    """Return the ends of a row's intervals, "KEY_low" and "KEY_high" for each metric that it has a figure of."""
    values = {metric: trials.values(metric) for metric in metrics}
    # Metrics of the same trials share the draws.
    together: dict[bytes, list[Metric]] = {}
    for metric, found in values.items():
        if np.isfinite(found).any():
            together.setdefault(np.isfinite(found).tobytes(), []).append(metric)
    ends: dict[str, float] = {}
    for some in together.values():
        there = np.isfinite(values[some[0]])
        found_intervals = figure_intervals(
            [(values[metric][there], metric.reduction) for metric in some],
            trials.places[there, 0],
            np.random.default_rng(SEED),
        )
        for metric, (low, high) in zip(some, found_intervals, strict=True):
            ends |= {f"{metric.key}_low": low, f"{metric.key}_high": high}
    return ends
