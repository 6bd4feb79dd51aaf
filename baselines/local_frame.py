"""The frame that methods work in, and what they refuse in it."""

from __future__ import annotations

from regbench.contract import Problem
from regbench.geometry.local_frame import LocalFrame

__all__ = ["LocalFrame", "require_surface"]


def require_surface(problem: Problem) -> None:
    """Refuse clouds on which normals and features mean nothing.

    Raises:
        ValueError: A cloud has fewer than three distinct points.
    """
    for name, points in (("source", problem.source), ("target", problem.target)):
        others = points[(points != points[:1]).any(axis=1)]
        if (others == others[:1]).all():  # also true of none
            raise ValueError(f"the {name} cloud has fewer than 3 distinct points")
