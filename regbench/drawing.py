"""Figures of matplotlib, which is an extra."""

from __future__ import annotations

from typing import Any

from regbench.errors import UserError


def new_figure() -> Any:
    """Return an empty matplotlib figure; without pyplot, so that it needs no display and leaves no global state.

    Raises:
        UserError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise UserError('drawing needs matplotlib, which is not installed: pip install "regbench[plots]"') from None
    return Figure(layout="constrained")
