"""Two methods on the same trials, metric by metric."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regbench.metrics.samples import Samples
from regbench.metrics.table import Metric
from regbench.report.rundata import Group, RunData
from regbench.report.summary import CloudErrors, samples_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrialValues:
    """What the metrics say of every trial of a method on a protocol.

    Attributes:
        places: (n, 2) int64, (problem, repeat), ascending.
        known: (n,) bool: the truth is known, so that the trial has errors.
        timed: (n,) bool: it answered, and has both times.
        samples: Errors of the known trials, times of the timed ones.
    """

    places: NDArray[np.int64]
    known: NDArray[np.bool_]
    timed: NDArray[np.bool_]
    samples: Samples

    @classmethod
    def of(cls, group: Group, run: RunData, cloud_errors: CloudErrors | None = None) -> TrialValues:
        """Return those of a group of a run; `cloud_errors` is as `summarise` takes it."""
        trials = group.trials
        truths = run.truths[group.protocol.id, group.protocol.sha256].of(trials.problems)
        return cls(
            np.stack([trials.problems, trials.repeats], axis=1),
            ~np.isnan(truths[:, 0, 0]),
            trials.answered & np.isfinite(trials.time_ms) & np.isfinite(trials.cpu_ms),
            samples_of(group, run, cloud_errors or {}),
        )

    def values(self, metric: Metric) -> Array:
        """Return (n,) values, NaN where a trial has none."""
        found = metric.per_trial(self.samples)
        where = self.timed if metric.needs == "times" else self.known
        values = np.full(len(self.places), np.nan)
        if len(found) == where.sum():
            values[where] = found
        return values


def paired_values(first: TrialValues, second: TrialValues, metric: Metric) -> tuple[Array, Array]:
    """Return the values of a metric, (n,) each, of the trials that both have it of."""
    _, ours, theirs = paired(first, second, metric)
    return ours, theirs


def paired_means(first: TrialValues, second: TrialValues, metric: Metric) -> tuple[Array, Array]:
    """Return likewise one value for each problem, the mean over the repeats that both have: for a test.

    Repeats of one problem are no more evidence than one trial of it, where a method answers the same each time.
    """
    problems, ours, theirs = paired(first, second, metric)
    if (np.diff(problems) > 0).all():
        return ours, theirs
    _, place = np.unique(problems, return_inverse=True)
    each = np.bincount(place)
    return np.bincount(place, ours) / each, np.bincount(place, theirs) / each


def paired(first: TrialValues, second: TrialValues, metric: Metric) -> tuple[NDArray[np.int64], Array, Array]:
    """Return problems and values, (n,) each, of the trials that both have a value of."""
    ours, theirs, problems = first.values(metric), second.values(metric), first.places[:, 0]
    if not np.array_equal(first.places, second.places):
        at = {tuple(place): index for index, place in enumerate(second.places.tolist())}
        common = [(i, at[place]) for i, place in enumerate(map(tuple, first.places.tolist())) if place in at]
        mine = np.array([i for i, _ in common], dtype=np.intp)
        ours, problems, theirs = ours[mine], problems[mine], theirs[np.array([j for _, j in common], dtype=np.intp)]
    both = np.isfinite(ours) & np.isfinite(theirs)
    return problems[both], ours[both], theirs[both]
