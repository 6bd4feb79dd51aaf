"""The distribution of errors, or of times, over the trials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from regbench.metrics.table import Metric
from regbench.report.curves import ecdf
from regbench.report.figures.axes import logarithmic, mark_evenly, shares
from regbench.report.figures.look import Look, looks
from regbench.report.figures.panel import Array, Material, Panel
from regbench.report.figures.words import trial_words

POINTS = 400


def ecdf_panels(material: Material) -> list[Panel]:
    """Return a panel for each protocol and metric."""
    look = looks(material.methods)
    return [
        _panel(label, metric, {group.method.method: material.values(group, metric) for group in groups}, look)
        for label, groups in material.protocols.items()
        for metric in material.metrics
    ]


def _panel(label: str, metric: Metric, values: Mapping[str, Array], look: Mapping[str, Look]) -> Panel:
    def draw(panel: Any) -> None:
        least = logarithmic(panel, "x", values.values())
        for method, some in values.items():
            if len(some):
                x, y = ecdf(some, POINTS)
                # From the axis's lower end, where what is less stands too, to its upper one.
                x = np.concatenate([[least], np.maximum(x, least), [max(least, panel.get_xlim()[1])]])
                y = np.concatenate([[0.0], y, [1.0]])
                panel.plot(x, y, drawstyle="steps-post", **look[method].line())
        mark_evenly(panel)
        shares(panel, "y")
        panel.set(xlabel=trial_words(metric), ylabel="share of trials at most")

    return Panel(label, draw)
