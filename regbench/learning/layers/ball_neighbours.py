"""The nearest neighbours of each point within a ball, a fixed number of them."""

from __future__ import annotations

import torch
from torch import Tensor


def ball_neighbours(points: Tensor, radius: float, k: int) -> Tensor:
    """Return the k nearest points within a radius of each point of its own cloud, in no order.

    A point counts among its own neighbours and takes the places of those that are missing, so that a maximum over
    them is not changed. (RPM-Net's code takes the first k of the cloud's order, which is not the same for a permuted
    cloud.)

    Args:
        points: (B, N, 3) floating point.
        radius: In the points' unit; a neighbour may lie on the ball.
        k: Neighbours per point, the point itself counted.

    Returns:
        (B, N, k) int64 indices into the N points.

    Raises:
        ValueError: `points` is not (B, N, 3), radius < 0 or k < 1.
    """
    if points.ndim != 3 or points.shape[2] != 3 or radius < 0 or k < 1:
        raise ValueError(f"ball_neighbours needs (B, N, 3) points and k >= 1: {tuple(points.shape)}, {radius}, {k}")
    points = points.detach()
    return _compiled(points, radius, k) if points.device.type == "cpu" else _selected(points, radius, k)


def _compiled(points: Tensor, radius: float, k: int) -> Tensor:
    from regbench.learning.layers.ball_loops import nearest_in_ball
    from regbench.learning.layers.threads import as_many_as_torch

    chosen = torch.empty((*points.shape[:2], k), dtype=torch.int64)
    with as_many_as_torch():
        nearest_in_ball(points.contiguous().numpy(), radius**2, chosen.numpy())
    return chosen


def _selected(points: Tensor, radius: float, k: int) -> Tensor:
    clouds, count, _ = points.shape
    # Differences, not products: |x|^2 + |y|^2 - 2xy loses digits where points are near. Not torch.cdist, which took
    # 70 % of a training step of RPM-Net on an H200.
    distances = (points[:, :, None] - points[:, None]).square().sum(dim=3).sqrt()
    nearest = distances.topk(min(k, count), dim=2, largest=False, sorted=False)
    chosen = torch.arange(count, device=points.device)[None, :, None].repeat(clouds, 1, k)
    chosen[:, :, :count] = torch.where(nearest.values <= radius, nearest.indices, chosen[:, :, :count])
    return chosen
