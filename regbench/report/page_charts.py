"""The figures behind a page's charts: for each method on a protocol its curves, its times, its place in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from regbench.metrics.table import METRICS, Metric
from regbench.report.curves import ecdf, pareto_front, shares_within
from regbench.report.rundata import Group, RunData
from regbench.report.summary import samples_of
from regbench.report.trial_errors import DEG_PER_LENGTH, trial_errors

# Recall is drawn up to the widest of the tables' thresholds.
MAX_ROTATION_DEG = 15.0
THRESHOLDS_DEG = np.linspace(0.0, MAX_ROTATION_DEG, 61)
ECDF_POINTS = 150
TIME_QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
DIGITS = 5


def charts(groups: Sequence[Group], run: RunData) -> dict[str, Any]:
    """Return what the page's script draws of one protocol, ready for JSON.

    A failed trial counts as the identity in the curves, as in the tables; times are of the trials that answered.
    """
    return {
        "thresholds_deg": numbers(THRESHOLDS_DEG),
        "deg_per_length": DEG_PER_LENGTH,
        "methods": [_method(group, run) for group in groups],
        "planes": planes(groups, run),
    }


def _method(group: Group, run: RunData) -> dict[str, Any]:
    errors = trial_errors(group, run)
    rotation, translation = errors.rotation_errors_deg, errors.translation_errors
    time_ms = samples_of(group, run, {}).time_ms
    return {
        "name": group.method.method,
        "recall": {
            "both": numbers(shares_within(errors.misses_deg, THRESHOLDS_DEG)),
            "rotation": numbers(shares_within(rotation, THRESHOLDS_DEG)),
            "translation": numbers(shares_within(translation, THRESHOLDS_DEG / DEG_PER_LENGTH)),
        },
        "ecdf": {
            name: [numbers(axis) for axis in ecdf(values, ECDF_POINTS)]
            for name, values in (("rotation", rotation), ("translation", translation))
        },
        "time_ms": numbers(np.quantile(time_ms, TIME_QUANTILES)) if len(time_ms) else None,
        "timed": len(time_ms),
    }


def planes(groups: Sequence[Group], run: RunData) -> list[dict[str, Any]]:
    """Return for each metric of accuracy every method's median time and figure, and which no other beats in both.

    What sees the ground truth beats nobody: it is drawn, but is not on the front and keeps no one off it.
    """
    samples = [samples_of(group, run, {}) for group in groups]
    found = []
    for metric in (metric for metric in METRICS.values() if metric.needs == "motions"):
        points = [
            (group, time, value)
            for group, sample in zip(groups, samples, strict=True)
            if math.isfinite(time := METRICS["time_median_ms"].figure(sample))
            and math.isfinite(value := metric.figure(sample))
        ]
        fair = [point for point in points if not point[0].method.sees_ground_truth]
        front = pareto_front([time for _, time, _ in fair], [gain(metric, value) for *_, value in fair])
        on_front = {group.method.method for (group, *_), is_on in zip(fair, front, strict=True) if is_on}
        found.append(
            {
                "key": metric.key,
                "name": f"{metric.name} ({metric.unit})",
                "higher_is_better": metric.higher_is_better,
                "points": [
                    {
                        "name": group.method.method,
                        "time_ms": number(time),
                        "value": number(value),
                        "front": group.method.method in on_front,
                    }
                    for group, time, value in points
                ],
            }
        )
    return found


def gain(metric: Metric, value: float) -> float:
    """Return a figure of which more is better."""
    return value if metric.higher_is_better else -value


def number(value: float) -> float | None:
    """Return a number of few digits, as short as JSON allows; None where it is not finite."""
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def numbers(values: ArrayLike) -> list[float | None]:
    """Return (n,) numbers likewise."""
    return [number(value) for value in np.asarray(values, dtype=np.float64).tolist()]
