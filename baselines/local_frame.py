"""The frame that methods work in, and what they refuse in it."""

from __future__ import annotations

import numpy as np

from regbench.contract import Problem
from regbench.geometry.local_frame import LocalFrame

__all__ = ["LocalFrame", "require_like_sizes", "require_surface"]

# The sums of squares of a cloud this much larger than the other are still 32-bit numbers.
MOST_TIMES_LARGER = 1e12


def require_surface(problem: Problem) -> None:
    """Refuse clouds on which normals and features mean nothing.

    Raises:
        ValueError: A cloud has fewer than three distinct points.
    """
    for name, points in (("source", problem.source), ("target", problem.target)):
        others = points[(points != points[:1]).any(axis=1)]
        if (others == others[:1]).all():  # also true of none
            raise ValueError(f"the {name} cloud has fewer than 3 distinct points")


def require_like_sizes(frame: LocalFrame) -> None:
    """Refuse clouds of sizes with which a search in 32-bit numbers means nothing.

    Raises:
        ValueError: The source is very much larger than the target.
    """
    if np.abs(frame.source).max() > MOST_TIMES_LARGER:
        raise ValueError(f"the source cloud is over {MOST_TIMES_LARGER:g} times as large as the target")
