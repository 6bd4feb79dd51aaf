"""A problem for methods to compile on before the clock runs."""

from __future__ import annotations

import numpy as np

from regbench.contract import Problem

POINTS = 60


def small_problem() -> Problem:
    """Return two clouds of 60 points each that do not match: registering them runs every stage of a method."""
    source, target = np.random.default_rng(0).normal(size=(2, POINTS, 3))
    return Problem(source=source, target=target)
