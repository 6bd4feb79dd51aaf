"""Accuracy against time, with the front: the methods that no other beats in both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from regbench.metrics.table import Metric
from regbench.report.figures.axes import logarithmic, shares
from regbench.report.figures.look import Look, looks
from regbench.report.figures.panel import Material, Panel
from regbench.report.figures.words import axis_words
from regbench.report.planes import Place, plane

TIME_WORDS = "median time (ms)"
FRONT = {"color": "#777777", "linewidth": 0.8, "linestyle": "-"}
FRONT_WORDS = "front (filled)"
MARKER_SIZE = 5.5


def pareto_panels(material: Material) -> list[Panel]:
    """Return a panel for each protocol and metric."""
    look = looks(material.methods)
    panels = []
    for label, groups in material.protocols.items():
        samples = [material.samples(group) for group in groups]
        panels += [_panel(label, metric, plane(groups, samples, metric), look) for metric in material.metrics]
    return panels


def _panel(label: str, metric: Metric, places: Sequence[Place], look: Mapping[str, Look]) -> Panel:
    def draw(panel: Any) -> None:
        logarithmic(panel, "x", [np.array([place.time_ms for place in places])])
        least = 0.0
        if metric.higher_is_better:
            shares(panel, "y")
        else:  # errors span decades; a zero stands at the foot
            least = logarithmic(panel, "y", [np.array([place.value for place in places])])
        front = sorted((place for place in places if place.on_front), key=lambda place: place.time_ms)
        panel.step([p.time_ms for p in front], [max(p.value, least) for p in front], where="post", zorder=1, **FRONT)
        for place in places:
            point = look[place.method].point(filled=place.on_front)
            panel.plot(
                [place.time_ms], [max(place.value, least)], linestyle="none", ms=MARKER_SIZE, clip_on=False, **point
            )
        panel.set(xlabel=TIME_WORDS, ylabel=axis_words(metric))

    return Panel(label, draw)
