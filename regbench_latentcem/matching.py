"""Motions on which matched points agree: candidates that know nothing of centroids, so that clouds may be cropped.

Each point is described by what surrounds it, points of like surroundings are matched, and motions come from groups
of matches that keep each other's distances (second-order spatial compatibility; Chen et al., SC2-PCR, 2022).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from regbench.learning.layers.weighted_kabsch import rotation_of_covariance

from .invariants import gaussian_windows

DESCRIPTORS = 4 * 8 + 6 * 3
# Only so many points of a larger cloud are matched, and only so many of the matches are compared: N^2 each.
MOST_POINTS = 1536
MOST_MATCHES = 900
# Two matches agree if they keep their distance to so much, in extents of the target.
TOLERANCE = 0.03
SEEDS = 120
NEAREST = 12


def local_descriptors(cloud: Tensor) -> Tensor:
    """Return what no rigid motion of an (N, 3) cloud changes around each of its points: (N, 50).

    For each Gaussian window: the spreads, how far its mean is from the point, in all and along each axis, and the
    density; for each two windows: how their normals and means lie to one another.
    """
    with torch.no_grad():
        windows = gaussian_windows(cloud[None], cloud[None])
        features, normals, offsets = [], [], []
        for window in windows:
            spreads, axes, offset = window.spreads[0], window.axes[0], window.offset[0]
            along = (offset[:, :, None] * axes).sum(dim=1).abs()
            features += [spreads, torch.linalg.vector_norm(offset, dim=1, keepdim=True), along, window.density[0]]
            normals.append(axes[:, :, 0])
            offsets.append(offset)
        for a in range(len(windows)):
            for b in range(a + 1, len(windows)):
                length = 0.05 + torch.linalg.vector_norm(offsets[b], dim=1)
                features.append(
                    torch.stack(
                        [
                            (normals[a] * normals[b]).sum(dim=1).abs(),
                            (offsets[a] * offsets[b]).sum(dim=1) / length,
                            (normals[a] * offsets[b]).sum(dim=1).abs(),
                        ],
                        dim=1,
                    )
                )
        return torch.cat(features, dim=1)


class Matcher(nn.Module):
    """Descriptors to a space where the same point of two clouds is near: a linear map, fitted in closed form.

    Args:
        size: Dimensions of that space.
    """

    def __init__(self, *, size: int = 16) -> None:
        super().__init__()
        self.projection = nn.Parameter(torch.eye(DESCRIPTORS, dtype=torch.float64)[:, :size].clone())

    def forward(self, cloud: Tensor) -> Tensor:
        """Map an (N, 3) cloud to (N, size)."""
        return local_descriptors(cloud) @ self.projection.to(cloud)

    def motions(self, source: Tensor, target: Tensor) -> Tensor:
        """Return motions T_target_source on which many matches agree, most agreed first: (S, 4, 4), S <= 120.

        Args:
            source: (N, 3) float64, in units of the target's extent.
            target: (M, 3) float64.
        """
        source, target = _thinned(source), _thinned(target)
        X, Y = _matches(source, target, self(source), self(target))
        return consensus(X, Y) if len(X) > NEAREST else X.new_empty((0, 4, 4))


def _thinned(cloud: Tensor) -> Tensor:
    """Return every k-th point, so that at most MOST_POINTS are left."""
    return cloud[:: -(-len(cloud) // MOST_POINTS)]


def _matches(source: Tensor, target: Tensor, of_source: Tensor, of_target: Tensor) -> tuple[Tensor, Tensor]:
    """Return the points of the closest matches: each point's nearest in the other cloud, either way; (K, 3) both."""
    distances = torch.cdist(of_source, of_target)
    to_target, to_source = distances.argmin(dim=1), distances.argmin(dim=0)
    forth = torch.arange(len(source)) * len(target) + to_target
    back = to_source * len(target) + torch.arange(len(target))
    pairs = torch.unique(torch.cat([forth, back]))
    closest = distances.flatten()[pairs].argsort()[:MOST_MATCHES]
    i, j = pairs[closest] // len(target), pairs[closest] % len(target)
    return source[i], target[j]


def consensus(X: Tensor, Y: Tensor) -> Tensor:
    """Return motions from groups of matches X[k] -> Y[k] that keep each other's distances: (S, 4, 4), best first."""
    compatible = ((torch.cdist(X, X) - torch.cdist(Y, Y)).abs() < TOLERANCE).float().fill_diagonal_(0)
    # How many further matches two matches have in common: wrong ones agree by chance in twos, not in threes.
    shared = compatible * (compatible @ compatible)
    seeds = shared.sum(dim=1).argsort(descending=True)[: 3 * SEEDS : 3]
    groups = torch.zeros(len(seeds), len(X), dtype=X.dtype)
    groups.scatter_(1, shared[seeds].topk(NEAREST, dim=1).indices, 1.0)
    for _ in range(2):
        T = _weighted_kabsch(groups, X, Y)
        misses = torch.linalg.vector_norm(X @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3] - Y, dim=2)
        agreed = (misses < 1.5 * TOLERANCE).to(X)
        groups = torch.where((agreed.sum(dim=1) >= 3)[:, None], agreed, groups)
    return T[agreed.sum(dim=1).argsort(descending=True)]


def _weighted_kabsch(weights: Tensor, X: Tensor, Y: Tensor) -> Tensor:
    """Return the best motions of X onto Y for (S, K) weights: (S, 4, 4).

    The points are the same for all weights, so that their products are made once: a quarter of the time of the
    framework's `weighted_kabsch` on S copies of them.
    """
    shares = weights / weights.sum(dim=1, keepdim=True)
    mean_x, mean_y = shares @ X, shares @ Y
    products = (Y[:, :, None] * X[:, None, :]).flatten(1)
    H = (shares @ products).reshape(-1, 3, 3) - mean_y[:, :, None] * mean_x[:, None, :]
    T = torch.eye(4, dtype=X.dtype).repeat(len(weights), 1, 1)
    T[:, :3, :3] = rotation_of_covariance(H)
    T[:, :3, 3] = mean_y - (T[:, :3, :3] @ mean_x[:, :, None]).squeeze(2)
    return T
