"""A metric by category, where a data set has categories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from regbench.metrics.reduction import reduce
from regbench.metrics.table import Metric
from regbench.report.paired import TrialValues
from regbench.report.problem_names import ProblemName
from regbench.report.rundata import Group, RunData
from regbench.report.summary import CloudErrors

# The recall that a page shows by category.
THRESHOLD = "5deg"


@dataclass(frozen=True)
class Categories:
    """A table: a row for each category, a column for each method.

    Attributes:
        methods: The columns.
        rows: Category, number of problems, and each method's figure; None without a trial.
    """

    methods: Sequence[str]
    rows: Sequence[tuple[str, int, Sequence[float | None]]]


def by_category(
    groups: Sequence[Group],
    run: RunData,
    names: Mapping[tuple[str, int], ProblemName],
    metric: Metric,
    cloud_errors: CloudErrors | None = None,
) -> Categories | None:
    """Return a metric of some methods on one protocol by category, or None where there are not two categories.

    Problems of unknown truth are in no category. `cloud_errors` is as `summarise` takes it.
    """
    trials = [TrialValues.of(group, run, cloud_errors) for group in groups]
    protocol = groups[0].protocol.id
    labels = {problem: name.label for (id, problem), name in names.items() if id == protocol and name.label}
    seen = {problem for found in trials for problem in found.places[found.known, 0].tolist() if problem in labels}
    categories = sorted({labels[problem] for problem in seen})
    if len(categories) < 2:
        return None
    values = [found.values(metric) for found in trials]
    rows = []
    for category in categories:
        members = np.array([problem for problem in seen if labels[problem] == category])
        figures: list[float | None] = []
        for found, all_values in zip(trials, values, strict=True):
            inside = all_values[np.isin(found.places[:, 0], members) & np.isfinite(all_values)]
            figures.append(reduce(inside, metric.reduction) if len(inside) else None)
        rows.append((category, len(members), figures))
    return Categories([group.method.method for group in groups], rows)
