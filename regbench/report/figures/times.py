"""The distribution of times: a box for each method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from regbench.metrics.table import Metric
from regbench.report.curves import BOX_SHARES
from regbench.report.figures.axes import logarithmic
from regbench.report.figures.look import MEDIUM, characters
from regbench.report.figures.panel import Array, Material, Panel
from regbench.report.figures.words import method_words, trial_words, wrapped
from regbench.report.rundata import Group

# What names may take of a panel's width.
NAMES_SHARE = 0.45
LINE_HEIGHT, ROOM_FOR_AXIS = 0.13, 0.65
LEAST_ROW = 0.2


def time_panels(material: Material) -> list[Panel]:
    """Return a panel for each protocol and metric."""
    return [
        _panel(material, label, groups, metric)
        for label, groups in material.protocols.items()
        for metric in material.metrics
    ]


def _panel(material: Material, label: str, groups: Sequence[Group], metric: Metric) -> Panel:
    rows = [row for row in material.rows if row["protocol"] == label]
    width = characters(NAMES_SHARE * material.panel_width, MEDIUM)
    names = [wrapped(method_words(group.method.method, rows), width) for group in groups]
    values = [material.values(group, metric) for group in groups]

    def draw(panel: Any) -> None:
        logarithmic(panel, "x", values)
        there = [position for position, some in enumerate(values) if len(some)]
        panel.bxp(
            [_box(values[position]) for position in there],
            positions=there,
            orientation="horizontal",
            widths=0.6,
            patch_artist=True,
            boxprops={"facecolor": "#DDDDDD", "linewidth": 0.7},
            medianprops={"color": "black", "linewidth": 1.6},
            whiskerprops={"linewidth": 0.7},
            capprops={"linewidth": 0.7},
            flierprops={"marker": "|", "markersize": 4, "markeredgewidth": 0.7},
            manage_ticks=False,
        )
        panel.set(ylim=(len(names) - 0.5, -0.5), xlabel=trial_words(metric))  # the first on top
        panel.set_yticks(range(len(names)), names)
        panel.grid(visible=False, axis="y")

    row = max(LEAST_ROW, LINE_HEIGHT * max(name.count("\n") + 1 for name in names) + 0.05)
    return Panel(label, draw, row * len(names) + ROOM_FOR_AXIS)


def _box(values: Array) -> dict[str, Any]:
    least, low, q1, median, q3, high, most = np.quantile(values, BOX_SHARES).tolist()
    return {"med": median, "q1": q1, "q3": q3, "whislo": low, "whishi": high, "fliers": [least, most]}
