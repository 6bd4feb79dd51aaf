"""What a point knows of its surroundings and no rotation changes: 19 numbers."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

NEIGHBOURHOODS = (8, 32, 96)
# The distance to the centroid, then six numbers for each neighbourhood.
GROUPS = (1, 6, 6, 6)
INVARIANTS = sum(GROUPS)


def local_invariants(clouds: Tensor) -> Tensor:
    """Return the invariants of every point of centred clouds.

    The distance to the centroid |x|; then for the 8, 32 and 96 nearest other points (fewer in a smaller cloud), with
    their mean m: 2 |m - x|, |m|, 2 (m - x) . x, and twice the square roots of the three eigenvalues of their
    covariance. The factors bring the numbers to about one size on clouds of unit extent.

    Args:
        clouds: (B, N, 3), each about its centroid, N >= 1. In float64 the nearest points of a copy are the same ones.

    Returns:
        (B, N, 19), without gradients.
    """
    with torch.no_grad():
        features = [torch.linalg.vector_norm(clouds, dim=2)[:, :, None]]
        near = _nearest_others(clouds, max(NEIGHBOURHOODS))  # (B, N, k, 3)
        for size in NEIGHBOURHOODS:
            group = near[:, :, :size]
            mean = group.mean(dim=2)
            offset, spread = mean - clouds, group - mean[:, :, None]
            eigenvalues = torch.linalg.eigvalsh(spread.transpose(2, 3) @ spread / group.shape[2])
            features += [
                2 * torch.linalg.vector_norm(offset, dim=2)[:, :, None],
                torch.linalg.vector_norm(mean, dim=2)[:, :, None],
                2 * (offset * clouds).sum(dim=2)[:, :, None],
                2 * eigenvalues.clamp(min=0).sqrt(),
            ]
        return torch.cat(features, dim=2)


def _nearest_others(clouds: Tensor, most: int) -> Tensor:
    """Return the nearest other points, nearest first: (B, N, min(most, N - 1), 3); a single point is its own."""
    count = min(most + 1, clouds.shape[1])
    order = (nearest_by_tree if clouds.device.type == "cpu" else nearest_by_distances)(clouds, count)
    order = order[:, :, 1:] if count > 1 else order  # the first is the point itself, or one at the same place
    batch = torch.arange(len(clouds), device=clouds.device)[:, None, None]
    return clouds[batch, order]


def nearest_by_tree(clouds: Tensor, count: int) -> Tensor:
    """Return the `count` nearest points of every point, nearest first: (B, N, count). Any N; on the CPU."""
    orders = [cKDTree(cloud).query(cloud, count)[1].reshape(-1, count) for cloud in clouds.numpy()]
    return torch.from_numpy(np.stack(orders))


def nearest_by_distances(clouds: Tensor, count: int) -> Tensor:
    """Return the same from all N x N distances, for the many cores of a GPU."""
    distances = torch.cdist(clouds, clouds, compute_mode="donot_use_mm_for_euclid_dist")
    order: Tensor = distances.topk(count, dim=2, largest=False).indices
    return order
