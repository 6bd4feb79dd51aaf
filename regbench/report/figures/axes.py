"""Axes that spell their numbers out: matplotlib's own logarithmic ones speak mathtext."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# What is so much less than the greatest value stands at the edge of a logarithmic axis.
DECADES = 6
# How far apart the markers of a line are, as a share of the panel's diagonal.
BETWEEN_MARKERS = 0.22


def logarithmic(panel: Any, which: Literal["x", "y"], values: Iterable[Array]) -> float:
    """Make an axis logarithmic, from a power of ten on, and return its lower end; linear, and 0, if all are zero.

    Args:
        panel: matplotlib's axes.
        which: The axis.
        values: What is to be seen on it, none negative; a zero has no place, and is to be drawn at the lower end.
    """
    from matplotlib.ticker import FuncFormatter, NullFormatter

    everything = np.concatenate([np.asarray(some, dtype=np.float64).ravel() for some in values])
    positive = everything[np.isfinite(everything) & (everything > 0)]
    if not len(positive):
        return 0.0
    most = float(positive.max())
    last = math.ceil(math.log10(most))
    first = min(math.floor(math.log10(max(float(positive.min()), most * 10.0**-DECADES))), last - 1)
    # Two powers of ten at least are on the axis, so that its numbers say what it is.
    end = 10.0**last if last - first < 2 else min(most * 1.3, 10.0**last)
    panel.set(**{f"{which}scale": "log", f"{which}lim": (10.0**first, end)})
    axis = panel.xaxis if which == "x" else panel.yaxis
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
    axis.grid(visible=False, which="minor")
    return 10.0**first


def shares(panel: Any, which: Literal["x", "y"]) -> None:
    """Let an axis go from 0 to 1, with room for a line at either end."""
    panel.set(**{f"{which}lim": (-0.02, 1.03)})


def mark_evenly(panel: Any) -> None:
    """Put markers on all lines evenly, those of different lines at different places."""
    for position, line in enumerate(panel.lines):
        line.set_markevery((BETWEEN_MARKERS * position / len(panel.lines), BETWEEN_MARKERS))
