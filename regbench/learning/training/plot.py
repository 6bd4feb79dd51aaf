"""The picture of a training: every loss and every figure of the validation over the steps."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from regbench.files import write_atomically
from regbench.learning.training.log import LOSS, VALIDATION

COLUMNS = 3
PANEL_INCHES = (4.0, 2.6)


def plot_training(rows: Sequence[Mapping[str, float]], path: Path) -> None:
    """Draw losses.png.

    Args:
        rows: Of the log. A panel for each loss and figure; logarithmic where all its values are positive.
        path: PNG file to write.
    """
    # matplotlib takes half a second, and only a training draws. A figure without pyplot leaves no global state.
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(name for row in rows for name in row if name.startswith((LOSS, VALIDATION))))
    if not names:
        return
    lines = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(COLUMNS * PANEL_INCHES[0], lines * PANEL_INCHES[1]), layout="constrained")
    for position, name in enumerate(names):
        axes = figure.add_subplot(lines, COLUMNS, position + 1)
        points = [(row["step"], row[name]) for row in rows if name in row]
        is_loss = name.startswith(LOSS)
        axes.plot(*zip(*points, strict=True), color="C0" if is_loss else "C1", marker=None if is_loss else ".")
        axes.set_title(name, fontsize=9)
        axes.set_xlabel("step", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
        if all(value > 0 for _, value in points):
            axes.set_yscale("log")
    image = io.BytesIO()
    figure.savefig(image, format="png", dpi=110)
    write_atomically(path, image.getvalue())
