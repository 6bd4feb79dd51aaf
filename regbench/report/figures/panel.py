"""What figures are drawn from, and what they are put together of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.metrics.samples import Samples
from regbench.metrics.table import Metric
from regbench.report.rundata import Group, RunData
from regbench.report.summary import CloudErrors, Row, samples_of

Array = NDArray[np.float64]

# The height of a panel with curves or points, in inches.
PANEL_HEIGHT = 2.1


@dataclass(frozen=True, eq=False)
class Material:
    """Runs, and what is to be drawn of them.

    Attributes:
        run: The trials.
        protocols: Methods by the protocol's label.
        rows: As `summarise` gives them, one for each method and protocol.
        metrics: Those asked for, or the figure's own.
        cloud_errors: For the metrics that need the clouds, else None.
        width: Of the figure, in inches.
        columns: How many panels stand beside each other.
        choice: What of the figure's own choices was taken: see kinds.py.
    """

    run: RunData
    protocols: Mapping[str, Sequence[Group]]
    rows: Sequence[Row]
    metrics: Sequence[Metric]
    cloud_errors: CloudErrors | None
    width: float
    columns: int
    choice: Sequence[str]

    @property
    def panel_width(self) -> float:
        """Width of one panel with its names and numbers, in inches."""
        return self.width / self.columns

    @property
    def methods(self) -> list[str]:
        """Every method once, in the order of the runs."""
        return list(dict.fromkeys(group.method.method for groups in self.protocols.values() for group in groups))

    def samples(self, group: Group) -> Samples:
        """Return errors and times of one method on one protocol."""
        return samples_of(group, self.run, self.cloud_errors or {})

    def values(self, group: Group, metric: Metric) -> Array:
        """Return (n,) values of the trials that have one, in the metric's unit."""
        values = metric.per_trial(self.samples(group))
        return np.sqrt(values) if metric.reduction == "root mean" else values


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes:
        title: What stands above it.
        draw: Draws it into matplotlib's axes.
        height: In inches.
    """

    title: str
    draw: Callable[[Any], None]
    height: float = PANEL_HEIGHT
