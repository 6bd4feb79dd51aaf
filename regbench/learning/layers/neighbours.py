"""Nearest neighbours within batches of clouds, in the space of any features."""

from __future__ import annotations

import torch
from torch import Tensor


def nearest_neighbours(features: Tensor, k: int) -> Tensor:
    """Return the k nearest points of each point of its own cloud, the point itself among them, in no order.

    Squared distances come from one matrix product and are selected, not sorted. The term |x_i|^2 is left out: it is
    the same for every candidate j of a point i.

    Args:
        features: (B, N, C) floating point.
        k: Neighbours per point, the point itself counted, as in DGCNN's code; k > N is taken as N.

    Returns:
        (B, N, min(k, N)) int64 indices into the N points.

    Raises:
        ValueError: `features` is not (B, N, C) with N >= 1, or k < 1.
    """
    if features.ndim != 3 or features.shape[1] == 0 or k < 1:
        raise ValueError(f"nearest_neighbours needs (B, N, C) features, N >= 1, k >= 1: {tuple(features.shape)}, {k}")
    with torch.no_grad():
        # About the mean, products lose fewer digits: a distance is a difference of them.
        points = (features - features.mean(dim=1, keepdim=True)).float()
        half_squares = (points * points).sum(dim=2).mul_(0.5)
        k = min(k, features.shape[1])
        if points.device.type == "cpu":
            return _nearest_compiled(points, half_squares, k)
        farness = torch.baddbmm(half_squares[:, None, :], points, points.transpose(1, 2), alpha=-1)
        indices: Tensor = farness.topk(k, dim=2, largest=False, sorted=False).indices
        return indices


def _nearest_compiled(points: Tensor, half_squares: Tensor, k: int) -> Tensor:
    """The same cloud by cloud: one cloud's distances stay in the cache."""
    from regbench.learning.layers.nearest_loops import select_smallest
    from regbench.learning.layers.threads import as_many_as_torch

    chosen = torch.empty((*points.shape[:2], k), dtype=torch.int64)
    farness = points.new_empty((points.shape[1], points.shape[1]))
    with as_many_as_torch():
        for cloud, half_square, nearest in zip(points, half_squares, chosen, strict=True):
            torch.addmm(half_square, cloud, cloud.T, alpha=-1, out=farness)
            select_smallest(farness.numpy(), nearest.numpy())
    return chosen
