"""Two runs against each other: the same methods on the same problems, before and after a change."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from regbench.metrics.bootstrap import PairedValues, paired_intervals
from regbench.metrics.reduction import reduce
from regbench.metrics.table import Metric
from regbench.report.disturbed import are_disturbed
from regbench.report.paired import TrialValues, paired
from regbench.report.rundata import Group, RunData
from regbench.report.summary import CloudErrors
from regbench.report.truths import Truths
from regbench.runner.status import Status

Array = NDArray[np.float64]
Verdict = Literal["better", "worse", "same", "no difference shown"]
# The draws of the resamples: the same runs give the same intervals.
SEED = 0
# Rows that the second run lacks are named up to this many.
NAMED = 3


@dataclass(frozen=True)
class Difference:
    """One figure of a method on a protocol in both runs, over the trials that both have a value of.

    Attributes:
        metric: What is compared.
        n: Number of those trials.
        before: The first run's figure.
        after: The second's.
        low: Lower end of the 95 % interval of after less before (paired bootstrap over problems).
        high: Upper end.
    """

    metric: Metric
    n: int
    before: float
    after: float
    low: float
    high: float

    @property
    def change(self) -> float:
        """After less before."""
        return self.after - self.before

    @property
    def is_shown(self) -> bool:
        """Whether the interval leaves zero out."""
        return self.low > 0 or self.high < 0

    @property
    def verdict(self) -> Verdict:
        """In a word; "same" where no resample differs."""
        if self.is_shown:
            return "better" if (self.change > 0) == self.metric.higher_is_better else "worse"
        return "same" if self.low == self.high == self.change == 0 else "no difference shown"


@dataclass(frozen=True)
class Comparison:
    """A method on a protocol in both runs.

    Attributes:
        method: Its name.
        protocol: Id.
        n: Trials that both runs have.
        n_before: That the first has.
        n_after: That the second has.
        failures_before: Of these, in the first run.
        failures_after: In the second.
        has_changed: Whether its source, parameters or data are others.
        times_disturbed: Whether its times in one of the runs are not to be quoted (see disturbed.py).
        differences: One for each metric that both runs have values of.
    """

    method: str
    protocol: str
    n: int
    n_before: int
    n_after: int
    failures_before: int
    failures_after: int
    has_changed: bool
    times_disturbed: bool
    differences: Sequence[Difference]


def renamed(run: RunData, method: str, name: str) -> RunData:
    """Return the trials of one method alone, under a name that another method's have too: to compare the two."""
    groups = [
        replace(group, method=replace(group.method, method=name, fingerprint=""))
        for group in run.groups
        if group.method.method == method
    ]
    return replace(run, groups=groups)


def incomparable(before: RunData, after: RunData, metrics: Sequence[Metric]) -> list[str]:
    """Return in words what keeps two runs from being compared; empty if nothing does.

    Rows of the second run alone are no hindrance: there is nothing that they could be worse than.
    """
    theirs = {(group.method.method, group.protocol.id): group for group in after.groups if group.trials}
    times = any(metric.needs == "times" for metric in metrics)
    lost, reasons, truths_differ = [], [], []
    for ours in before.groups:
        if not ours.trials:
            continue
        other = theirs.get((ours.method.method, ours.protocol.id))
        if other is None:
            lost.append(f"{ours.method.method} on {ours.protocol.id}")
            continue
        if other.protocol.sha256 != ours.protocol.sha256:
            reasons.append(f"{ours.protocol.id} has other problems in the second run (another hash)")
        elif (problem := _truths(before, ours).differing(_truths(after, other))) is not None:
            truths_differ.append(f"problem {problem} of {ours.protocol.id} has another ground truth in the second run")
        for which, group in (("first", ours), ("second", other)):
            if len(group.trials) < group.planned:
                what = f"{group.method.method} on {group.protocol.id}"
                reasons.append(
                    f"the {which} run is unfinished: {len(group.trials)} of {group.planned} trials of {what}"
                )
        if times and _timing(ours) != _timing(other):
            reasons.append(f"times of {_timing(ours)} and of {_timing(other)}")
    if lost:
        more = f" and {len(lost) - NAMED} more" if len(lost) > NAMED else ""
        reasons.append(f"only the first run has {', '.join(lost[:NAMED])}{more}")
    if times and set(before.machines) != set(after.machines):
        reasons.append(f"times of {' and '.join(before.machines)}, and of {' and '.join(after.machines)}")
    return list(dict.fromkeys([*truths_differ, *reasons]))


def _truths(run: RunData, group: Group) -> Truths:
    return run.truths[group.protocol.id, group.protocol.sha256]


def _timing(group: Group) -> str:
    """Return what of a method's settings its times depend on: all but the seed."""
    return ", ".join(part for part in group.method.settings.split(", ") if not part.startswith("seed "))


def compare(
    before: RunData,
    after: RunData,
    metrics: Sequence[Metric],
    errors: tuple[CloudErrors, CloudErrors] | None = None,
) -> list[Comparison]:
    """Return what both runs have trials of, in the order of the first; problems are matched by number and repeat.

    Args:
        before: The first run.
        after: The second.
        metrics: What to compare.
        errors: Of both, for metrics that need the clouds.
    """
    cloud_errors = errors or ({}, {})
    theirs = {(group.method.method, group.protocol.id): group for group in after.groups}
    comparisons = []
    for ours in before.groups:
        other = theirs.get((ours.method.method, ours.protocol.id))
        common = set(ours.trials) & set(other.trials) if other else set()
        if other is None or not common:
            continue
        first = TrialValues.of(ours, before, cloud_errors[0])
        second = TrialValues.of(other, after, cloud_errors[1])
        comparisons.append(
            Comparison(
                method=ours.method.method,
                protocol=ours.protocol.id,
                n=len(common),
                n_before=len(ours.trials),
                n_after=len(other.trials),
                failures_before=_failures(ours, common),
                failures_after=_failures(other, common),
                has_changed=ours.method.fingerprint != other.method.fingerprint,
                times_disturbed=are_disturbed(ours.trials) or are_disturbed(other.trials),
                differences=list(_differences(first, second, metrics)),
            )
        )
    return comparisons


def _failures(group: Group, places: set[tuple[int, int]]) -> int:
    return sum(group.trials[place].status is not Status.OK for place in places)


def _differences(first: TrialValues, second: TrialValues, metrics: Sequence[Metric]) -> Iterator[Difference]:
    """Yield one for each metric; those over the same trials are resampled together."""
    values = {metric.key: paired(first, second, metric) for metric in metrics}
    intervals: dict[str, tuple[float, float]] = {}
    for places in {problems.tobytes() for problems, _, _ in values.values() if len(problems)}:
        alike = [metric for metric in metrics if values[metric.key][0].tobytes() == places]
        columns = [PairedValues(*values[metric.key][1:], metric.reduction) for metric in alike]
        problems = values[alike[0].key][0]
        found = paired_intervals(columns, np.random.default_rng(SEED), problems=problems)
        intervals |= {metric.key: limits for metric, limits in zip(alike, found, strict=True)}
    for metric in metrics:
        if metric.key in intervals:
            _, ours, theirs = values[metric.key]
            before, after = (reduce(column, metric.reduction) for column in (ours, theirs))
            yield Difference(metric, len(ours), before, after, *intervals[metric.key])
