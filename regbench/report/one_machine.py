"""Times of one machine: those of others do not compare, and are left out unless a reader asks for them."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from regbench.report.rundata import Group, RunData


def times_of_one_machine(run: RunData) -> RunData:
    """Return the trials with the times of that machine alone which timed the most of them; accuracy is of all."""
    timed: Counter[str] = Counter()
    for group in run.groups:
        timed.update(group.trials.machines[np.isfinite(group.trials.time_ms)].tolist())
    if len(timed) < 2:
        return run
    (machine, _), *others = timed.most_common()
    groups = [_timed_on(machine, group) for group in run.groups]
    return replace(run, groups=groups, machines=[machine], times_left_out=dict(others))


def _timed_on(machine: str, group: Group) -> Group:
    elsewhere = group.trials.machines != machine
    time_ms, cpu_ms = (np.where(elsewhere, np.nan, times) for times in (group.trials.time_ms, group.trials.cpu_ms))
    return replace(group, trials=replace(group.trials, time_ms=time_ms, cpu_ms=cpu_ms))
