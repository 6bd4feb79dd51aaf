"""The Chamfer distance with gradients."""

from __future__ import annotations

import torch
from torch import Tensor


def chamfer_distance(first: Tensor, second: Tensor) -> Tensor:
    """Return the Chamfer distance of pairs of clouds, as means of distances that are not squared.

    mean over x of min over y |x - y| + mean over y of min over x |x - y|: LatentCEM's Eq. 5 with its two sums made
    means, so that the value does not grow with the number of points.

    Args:
        first: (B, N, 3) floating point, N >= 1.
        second: (B, M, 3) of the same type, M >= 1.

    Returns:
        (B,) in the clouds' unit; both clouds receive gradients, none where two points coincide.
    """
    with torch.no_grad():
        # Differences, not products: |x|^2 + |y|^2 - 2xy loses half the digits where clouds are aligned.
        distances = torch.cdist(first, second, compute_mode="donot_use_mm_for_euclid_dist")
        nearest_in_second, nearest_in_first = distances.argmin(dim=2), distances.argmin(dim=1)
    return _mean_distance(first, second, nearest_in_second) + _mean_distance(second, first, nearest_in_first)


def _mean_distance(points: Tensor, others: Tensor, nearest: Tensor) -> Tensor:
    """Return the mean distance of (B, N, 3) points to those of the (B, M, 3) others that (B, N) indices name."""
    matched = others.gather(1, nearest[:, :, None].expand(-1, -1, 3))
    distances: Tensor = torch.linalg.vector_norm(points - matched, dim=2)
    return distances.mean(dim=1)
