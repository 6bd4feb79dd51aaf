"""Where local methods start: matched centroids, the identity, or the motion prior's mean rotation."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem
from regbench.geometry.local_frame import LocalFrame
from regbench.geometry.se3 import se3

Start: TypeAlias = Literal["centroid", "identity", "prior"]


def start_of(problem: Problem, frame: LocalFrame, init: Start) -> NDArray[np.float64]:
    """Return the (4, 4) start in the local frame. A start that the problem gives replaces centroid and identity.

    Raises:
        ValueError: `init` is "prior" and the problem discloses none.
    """
    if init == "prior":
        if problem.motion_prior is None:
            raise ValueError("init=prior needs a motion prior, and the problem discloses none")
        return se3(problem.motion_prior.mean_T_target_source()[:3, :3], np.zeros(3))
    if problem.init_T_target_source is not None:
        return frame.to_local(problem.init_T_target_source)
    return np.eye(4) if init == "centroid" else frame.to_local(np.eye(4))


def skip_without_prior(problem: Problem, init: Start) -> str | None:
    """Return why a problem without a motion prior is skipped by `init`, or None."""
    if init == "prior" and problem.motion_prior is None:
        return "init=prior needs a motion prior, and the protocol discloses none"
    return None
