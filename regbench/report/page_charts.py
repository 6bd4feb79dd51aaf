"""The figures behind a page's charts: for each method on a protocol its curves, its times, its place in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from regbench.metrics.table import METRICS
from regbench.report.curves import BOX_SHARES, ecdf
from regbench.report.planes import plane
from regbench.report.recall_curves import MAX_ROTATION_DEG, recall_curves
from regbench.report.rundata import Group, RunData
from regbench.report.summary import samples_of
from regbench.report.trial_errors import DEG_PER_LENGTH, trial_errors

THRESHOLDS_DEG = np.linspace(0.0, MAX_ROTATION_DEG, 61)
ECDF_POINTS = 150
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
    time_ms = samples_of(group, run, {}).time_ms
    return {
        "name": group.method.method,
        "recall": {name: numbers(shares) for name, shares in recall_curves(errors, THRESHOLDS_DEG).items()},
        "ecdf": {
            name: [numbers(axis) for axis in ecdf(values, ECDF_POINTS)]
            for name, values in (
                ("rotation", errors.rotation_errors_deg),
                ("translation", errors.translation_errors),
            )
        },
        "time_ms": numbers(np.quantile(time_ms, BOX_SHARES)) if len(time_ms) else None,
        "timed": len(time_ms),
    }


def planes(groups: Sequence[Group], run: RunData) -> list[dict[str, Any]]:
    """Return for each metric of accuracy every method's median time and figure, and who is on the front."""
    samples = [samples_of(group, run, {}) for group in groups]
    return [
        {
            "key": metric.key,
            "name": f"{metric.name} ({metric.unit})",
            "higher_is_better": metric.higher_is_better,
            "points": [
                {
                    "name": place.method,
                    "time_ms": number(place.time_ms),
                    "value": number(place.value),
                    "front": place.on_front,
                }
                for place in plane(groups, samples, metric)
            ],
        }
        for metric in METRICS.values()
        if metric.needs == "motions"
    ]


def number(value: float) -> float | None:
    """Return a number of few digits, as short as JSON allows; None where it is not finite."""
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def numbers(values: ArrayLike) -> list[float | None]:
    """Return (n,) numbers likewise."""
    return [number(value) for value in np.asarray(values, dtype=np.float64).tolist()]
