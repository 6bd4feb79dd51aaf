"""A figure for each method and category, or each method and protocol, written into its cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from regbench.errors import UserError
from regbench.metrics.table import Metric
from regbench.report.categories import by_category
from regbench.report.figures.look import LARGE, MEDIUM, SMALL, characters, inches
from regbench.report.figures.panel import Array, Material, Panel
from regbench.report.figures.words import axis_words, method_words, printable, wrapped
from regbench.report.problem_names import problem_names
from regbench.report.rundata import Group

BY = ("category", "protocol")
# The darkest grey of a cell, and from where on letters are white.
DARKEST, WHITE_FROM = 0.8, 0.62
EDGE = "#BBBBBB"
NONE = "-"
NAMES_SHARE = 0.45
UPRIGHT_CHARACTERS = 25
LINE_HEIGHT, MARGIN, ROOM_FOR_TITLE, ROOM_FOR_WORDS = 0.12, 0.04, 0.25, 0.2
PER_CENT, NOTE = ", %", "lighter is better"


@dataclass(frozen=True, eq=False)
class Cells:
    """A table to be drawn: (rows, columns) values, NaN where there is none, and the names of both."""

    title: str
    rows: Sequence[str]
    columns: Sequence[str]
    values: Array

    def upright(self) -> Cells:
        """Return the table with the longer list going down, as a page is higher than wide."""
        if len(self.columns) <= len(self.rows):
            return self
        return Cells(self.title, self.columns, self.rows, self.values.T)


def heatmap_panels(material: Material) -> list[Panel]:
    """Return a panel for each metric (and each protocol, where cells are of categories)."""
    by = material.choice[0] if material.choice else None
    if by == "protocol" or (by is None and len(material.protocols) > 1):
        return [_panel(_of_protocols(material, metric), metric, material) for metric in material.metrics]
    panels = []
    for label, groups in material.protocols.items():
        for metric in material.metrics:
            cells = _of_categories(material, label, groups, metric)
            if cells is None and by == "category":
                raise UserError(f"plot heatmap: {label} has no categories, or one alone; leave out --by category")
            panels.append(_panel(cells or _of_protocols(material, metric), metric, material))
    return panels


def _of_protocols(material: Material, metric: Metric) -> Cells:
    figures = {(row["method"], row["protocol"]): row.get(metric.key) for row in material.rows}
    values = [[figures.get((method, label)) for label in material.protocols] for method in material.methods]
    names = [method_words(method, material.rows) for method in material.methods]
    return Cells("", names, [printable(label) for label in material.protocols], np.array(values, dtype=np.float64))


def _of_categories(material: Material, label: str, groups: Sequence[Group], metric: Metric) -> Cells | None:
    names = problem_names(dict.fromkeys(folder for group in groups for folder in group.run_dirs))
    found = by_category(groups, material.run, names, metric, material.cloud_errors)
    if found is None:
        return None
    rows = [row for row in material.rows if row["protocol"] == label]
    return Cells(
        label,
        [printable(category) for category, *_ in found.rows],
        [method_words(method, rows) for method in found.methods],
        np.array([figures for *_, figures in found.rows], dtype=np.float64),
    )


def _panel(table: Cells, metric: Metric, material: Material) -> Panel:
    """Return the panel of a table.

    Raises:
        UserError: Its columns do not fit the figure's width.
    """
    cells = table.upright()
    texts = [[_text(value, metric) for value in row] for row in cells.values.tolist()]
    width = characters(NAMES_SHARE * material.panel_width, MEDIUM)
    rows = [wrapped(name, width) for name in cells.rows]
    columns = [wrapped(name, UPRIGHT_CHARACTERS) for name in cells.columns]
    across = max(inches(max(len(text) for row in texts for text in row), SMALL), _lines(columns) * LINE_HEIGHT) + MARGIN
    room = material.panel_width - inches(_longest(rows), MEDIUM) - 2 * MARGIN
    words = wrapped(f"{axis_words(metric)}{PER_CENT * metric.higher_is_better}; {NOTE}", characters(room, LARGE))
    if across * len(columns) > room:
        raise UserError(
            f"plot heatmap: {len(columns)} columns do not fit {material.panel_width:g} inches; give --width page, or "
            "choose fewer with --method and --protocol"
        )

    def draw(panel: Any) -> None:
        grey = _greys(cells.values, metric)
        panel.pcolormesh(np.ma.masked_invalid(grey), cmap="Greys", vmin=0, vmax=1, edgecolors=EDGE, linewidth=0.4)
        for (row, column), shade in np.ndenumerate(grey):
            panel.text(
                column + 0.5,
                row + 0.5,
                texts[row][column],
                size=SMALL,
                ha="center",
                va="center_baseline",
                color="white" if shade > WHITE_FROM else "black",
            )
        panel.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=90)
        panel.set_yticks(np.arange(len(rows)) + 0.5, rows)
        panel.tick_params(length=0)
        panel.set(ylim=(len(rows), 0), xlabel=words)  # the first on top
        panel.grid(visible=False)
        panel.spines[:].set_visible(False)

    height = len(rows) * (_lines(rows) * LINE_HEIGHT + MARGIN) + inches(_longest(columns), MEDIUM)
    return Panel(cells.title, draw, height + ROOM_FOR_TITLE * bool(cells.title) + ROOM_FOR_WORDS * _lines([words]))


def _greys(values: Array, metric: Metric) -> Array:
    """Return (r, c) greys from 0, the best, to DARKEST, the worst: shares from 1 to 0, errors by their logarithm."""
    if metric.higher_is_better:
        return (1 - values) * DARKEST
    positive = values[values > 0]
    if not len(positive):
        return values * 0.0
    low, high = float(np.log(positive.min())), float(np.log(positive.max()))
    logs = np.log(np.where(values > 0, values, positive.min())) + 0 * values
    return (logs - low) / max(high - low, 1e-9) * DARKEST


def _text(value: float, metric: Metric) -> str:
    """Return a figure of few digits: a share in per cent, which is 100 or 0 only where it is exactly that."""
    if not np.isfinite(value):
        return NONE
    if not metric.higher_is_better:
        return f"{value:.3g}"
    return f"{100 * value:g}" if value in (0, 1) else f"{min(max(100 * value, 0.1), 99.9):.1f}"


def _longest(texts: Sequence[str]) -> int:
    return max(len(line) for text in texts for line in text.splitlines())


def _lines(texts: Sequence[str]) -> int:
    return max(text.count("\n") + 1 for text in texts)
