"""Accuracy against time: where each method stands in the plane, and which of them no other beats in both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from regbench.metrics.samples import Samples
from regbench.metrics.table import METRICS, Metric
from regbench.report.curves import pareto_front
from regbench.report.rundata import Group


@dataclass(frozen=True)
class Place:
    """A method in the plane.

    Attributes:
        method: Its name.
        time_ms: Its median time.
        value: Its figure of the metric.
        on_front: Whether no other method is as fast and as accurate, and better in one of both.
    """

    method: str
    time_ms: float
    value: float
    on_front: bool


def plane(groups: Sequence[Group], samples: Sequence[Samples], metric: Metric) -> list[Place]:
    """Return the methods that have both a time and a figure.

    What sees the ground truth beats nobody: it is drawn, but is not on the front and keeps no one off it.

    Args:
        groups: Methods on one protocol.
        samples: Of the same groups.
        metric: Of accuracy.
    """
    found = [
        (group.method, time, value)
        for group, sample in zip(groups, samples, strict=True)
        if math.isfinite(time := METRICS["time_median_ms"].figure(sample))
        and math.isfinite(value := metric.figure(sample))
    ]
    fair = [point for point in found if not point[0].sees_ground_truth]
    front = pareto_front([time for _, time, _ in fair], [gain(metric, value) for *_, value in fair])
    on_front = {method.method for (method, *_), is_on in zip(fair, front, strict=True) if is_on}
    return [Place(method.method, time, value, method.method in on_front) for method, time, value in found]


def gain(metric: Metric, value: float) -> float:
    """Return a figure of which more is better."""
    return value if metric.higher_is_better else -value
