"""From trials to figures: one object per method and protocol."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.metrics.samples import Samples
from regbench.metrics.table import METRICS, Metric
from regbench.report.rundata import Group, RunData
from regbench.report.trials import Trials

Array = NDArray[np.float64]
Row = dict[str, Any]
CloudErrors = Mapping[str, Mapping[str, float]]


def summarise(run: RunData, cloud_errors: CloudErrors | None = None) -> list[Row]:
    """Return one row per method and protocol.

    A failed trial is scored as if the method had answered the identity. Accuracy is over the trials whose ground truth
    is known; times are over the trials that answered. A figure with nothing to compute it from is None.

    Args:
        run: The trials.
        cloud_errors: By metric key, then by trial key (see cloud_metrics.py), for the metrics that need the clouds.

    Returns:
        Rows with the keys method, protocol, n (trials scored), failures (by status, those that occur), then every
        metric; then kind, sees_ground_truth, training (of its weights, in words), batch (problems answered at a time),
        planned (trials), n_truth (trials of known truth), note.
    """
    errors = cloud_errors or {}
    return [summarise_group(group, samples_of(group, run, errors), errors) for group in run.groups]


def summarise_group(group: Group, samples: Samples, cloud_errors: CloudErrors) -> Row:
    """Return the row of one method on one protocol, whose samples these are; see `summarise`."""
    figures = {
        metric.key: _figure(metric, samples)
        for metric in METRICS.values()
        if metric.needs != "clouds" or metric.key in cloud_errors
    }
    return {
        "method": group.method.method,
        "protocol": group.protocol.label,
        "n": len(group.trials),
        "failures": group.trials.failures(),
        **figures,
        "kind": group.method.kind,
        "sees_ground_truth": group.method.sees_ground_truth,
        "training": group.method.training,
        "batch": group.method.batch,
        "planned": group.planned,
        "n_truth": len(samples.rotation_errors_deg),
        "note": None,
    }


def samples_of(group: Group, run: RunData, cloud_errors: CloudErrors) -> Samples:
    """Return errors and times of one method on one protocol."""
    trials = group.trials
    truths = run.truths[group.protocol.id, group.protocol.sha256].of(trials.problems)
    known = ~np.isnan(truths[:, 0, 0])
    by_metric = {
        key: np.array([errors[name] for name in trials.trial_keys[known] if name in errors], dtype=np.float64)
        for key, errors in cloud_errors.items()
    }
    empty = np.empty(0)
    return Samples.of_motions(
        trials.T_target_source[known],
        truths[known],
        time_ms=_times(trials.time_ms, trials),
        cpu_ms=_times(trials.cpu_ms, trials),
        symmetry_aware_errors=by_metric.get("symmetry_aware_error", empty),
        modified_chamfers=by_metric.get("modified_chamfer", empty),
    )


def _times(values_ms: Array, trials: Trials) -> Array:
    """Return the times of the trials that answered; a trial without a measurement is left out."""
    return values_ms[trials.answered & np.isfinite(values_ms)]


def _figure(metric: Metric, samples: Samples) -> float | None:
    value = metric.figure(samples)
    return None if math.isnan(value) else value


def sections(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows by protocol, in the order in which protocols first occur."""
    by_protocol: dict[str, list[Row]] = {}
    for row in rows:
        by_protocol.setdefault(row["protocol"], []).append(row)
    return by_protocol
