"""What may follow the planner. It sees the two clouds, and no ground truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.chamfer import chamfer_distance
from regbench.geometry.icp import icp
from regbench.geometry.se3 import transform

Motion = NDArray[np.float64]
Points = NDArray[np.float64]

# How many of the ranked candidates are refined.
REFINED = 3


def verified(candidates: Sequence[Motion], source: Points, target: Points, icp_iterations: int) -> tuple[Motion, float]:
    """Return the best of several motions after ICP, and its Chamfer distance.

    The candidates are ranked by the true Chamfer distance, the first ones are refined by ICP, and of what comes out
    and of the first one itself the motion of least Chamfer distance is the answer.

    Args:
        candidates: (4, 4) motions T_target_source, at least one.
        source: (N, 3).
        target: (M, 3).
        icp_iterations: Most iterations of ICP.
    """

    def distance(T: Motion) -> float:
        return chamfer_distance(transform(T, source), target)

    ranked = sorted(((distance(T), i) for i, T in enumerate(candidates)))
    best = candidates[ranked[0][1]]
    refined = [
        icp(source, target, candidates[i], max_iterations=icp_iterations).T_target_source for _, i in ranked[:REFINED]
    ]
    scored = [(distance(T), T) for T in refined] + [(ranked[0][0], best)]
    least, answer = min(scored, key=lambda pair: pair[0])
    return answer, least
