"""Recall by category, where a data set has categories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from regbench.metrics.recall import THRESHOLDS, recall
from regbench.report.problem_names import ProblemName
from regbench.report.rundata import Group, RunData
from regbench.report.trial_errors import trial_errors

THRESHOLD = "5deg"


@dataclass(frozen=True)
class Categories:
    """A table: a row for each category, a column for each method.

    Attributes:
        methods: The columns.
        rows: Category, number of problems, and each method's recall within THRESHOLD; None without a trial.
    """

    methods: Sequence[str]
    rows: Sequence[tuple[str, int, Sequence[float | None]]]


def by_category(
    groups: Sequence[Group], run: RunData, names: Mapping[tuple[str, int], ProblemName]
) -> Categories | None:
    """Return the recall of some methods on one protocol by category, or None where there are not two categories."""
    errors = [trial_errors(group, run) for group in groups]
    protocol = groups[0].protocol.id
    labels = {problem: name.label for (id, problem), name in names.items() if id == protocol and name.label}
    seen = {problem for found in errors for problem in found.problems.tolist() if problem in labels}
    categories = sorted({labels[problem] for problem in seen})
    if len(categories) < 2:
        return None
    degrees, length = THRESHOLDS[THRESHOLD]
    rows = []
    for category in categories:
        members = np.array([problem for problem in seen if labels[problem] == category])
        shares: list[float | None] = []
        for found in errors:
            inside = np.isin(found.problems, members)
            within = recall(found.rotation_errors_deg[inside], found.translation_errors[inside], degrees, length)
            shares.append(within if inside.any() else None)
        rows.append((category, len(members), shares))
    return Categories([group.method.method for group in groups], rows)
