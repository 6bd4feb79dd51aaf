"""Panels on one sheet with one legend, and the sheet as a file."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from regbench.drawing import new_figure
from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.report.figures.look import LARGE, MEDIUM, characters, inches
from regbench.report.figures.panel import Material, Panel
from regbench.report.figures.words import printable, wrapped

# What a file would say of when it was made: left out, so that the same run gives the same bytes.
UNDATED: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}
LINE_HEIGHT, HANDLE_WIDTH = 0.15, 0.55
TITLE_HEIGHT = 0.2


def arrange(panels: Sequence[Panel], material: Material, legend: Sequence[tuple[str, dict[str, Any]]]) -> Any:
    """Return the figure of some panels, so wide and so many abreast as the material says.

    Args:
        panels: At least one.
        material: What they are of.
        legend: Words and matplotlib's properties of a line; none for no legend.
    """
    width, columns = material.width, material.columns
    lines = [panels[first : first + columns] for first in range(0, len(panels), columns)]
    titles = [wrapped(printable(panel.title), characters(material.panel_width, LARGE)) for panel in panels]
    extra = TITLE_HEIGHT * max(title.count("\n") for title in titles)
    heights = [max(panel.height for panel in line) + extra for line in lines]
    figure = new_figure()
    figure.get_layout_engine().set(w_pad=0.03, h_pad=0.03)
    legend_height = _legend(figure, width, legend) if legend else 0.0
    figure.set_size_inches(width, sum(heights) + legend_height)
    grid = figure.subplots(len(lines), columns, squeeze=False, height_ratios=heights)
    for axes, panel, title in zip(grid.flat, panels, titles, strict=False):
        panel.draw(axes)
        axes.set_title(title)
    for axes in grid.flat[len(panels) :]:
        axes.remove()
    return figure


def _legend(figure: Any, width: float, entries: Sequence[tuple[str, dict[str, Any]]]) -> float:
    """Draw the legend below the panels and return its height in inches."""
    from matplotlib.lines import Line2D

    room = characters(width - HANDLE_WIDTH - 0.1, MEDIUM)
    words = [wrapped(text, room) for text, _ in entries]
    longest = max(len(line) for text in words for line in text.splitlines())
    columns = max(1, min(len(words), int(width / (inches(longest, MEDIUM) + HANDLE_WIDTH))))
    handles = [Line2D([], [], **properties) for _, properties in entries]
    figure.legend(
        handles, words, loc="outside lower center", ncols=columns, frameon=False, columnspacing=1.0, handlelength=2.8
    )
    tallest = [max(text.count("\n") + 1 for text in words)] * -(-len(words) // columns)
    return LINE_HEIGHT * sum(tallest) + 0.1


def save(figure: Any, path: Path) -> None:
    """Write a figure, whole or not at all; the same figure gives the same bytes.

    Raises:
        UserError: The file's name has another ending than .pdf, .svg or .png, or it cannot be written.
    """
    image = io.BytesIO()
    format = format_of(path)
    figure.savefig(image, format=format, metadata=UNDATED[format])
    write_atomically(path, image.getvalue())


def format_of(path: Path) -> str:
    """Return the format that a file's name asks for.

    Raises:
        UserError: There is no such format.
    """
    format = path.suffix.lower().removeprefix(".")
    if format not in UNDATED:
        raise UserError(f"--out {path}: a figure is saved as PDF, SVG or PNG; let its name end in .pdf, .svg or .png")
    return format
