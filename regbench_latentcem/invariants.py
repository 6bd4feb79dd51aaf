"""What a point knows of its surroundings and no rotation changes.

Surroundings are Gaussian windows of several widths, not the k nearest points: they change smoothly with every point,
and little when the cloud is sampled anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

# Standard deviations of the windows in extents. Each is half the one before: see `_weights`.
WIDTHS = (0.4, 0.2, 0.1, 0.05)
# The encoder's groups of invariants: the distance to the centroid, then seven numbers for each of the wider windows.
# The narrowest one moves with the noise.
ENCODER_WIDTHS = 3
GROUPS = (1, 7, 7, 7)
INVARIANTS = sum(GROUPS)
# Rows of the N x N weights that are held at a time.
CHUNK = 1024


@dataclass(frozen=True, eq=False)
class Window:
    """Moments of a cloud within a Gaussian window about each of B x n points, lengths in the window's width.

    Attributes:
        offset: (B, n, 3), from the point to the mean.
        mean: (B, n, 3), in the cloud's unit.
        spreads: (B, n, 3), square roots of the covariance's eigenvalues, least first.
        axes: (B, n, 3, 3), its eigenvectors as columns; their signs mean nothing.
        density: (B, n, 1), 0.3 times the logarithm of the mean weight: about as variable as the others.
    """

    offset: Tensor
    mean: Tensor
    spreads: Tensor
    axes: Tensor
    density: Tensor


def local_invariants(clouds: Tensor) -> Tensor:
    """Return the encoder's invariants of every point of centred clouds.

    The distance to the centroid |x|; then for each window with mean m, of width s: |m - x| / s, |m|,
    (m - x) . x / s, the three spreads and the density.

    Args:
        clouds: (B, N, 3), each about its centroid, N >= 1, in units of its extent. Time grows with N^2.

    Returns:
        (B, N, 22), without gradients.
    """
    with torch.no_grad():
        chunks = []
        for points in torch.split(clouds, CHUNK, dim=1):
            features = [_length(points)]
            for window in gaussian_windows(points, clouds, ENCODER_WIDTHS):
                inward = (window.offset * points).sum(dim=2, keepdim=True)
                features += [_length(window.offset), _length(window.mean), inward, window.spreads, window.density]
            chunks.append(torch.cat(features, dim=2))
        return torch.cat(chunks, dim=1)


def gaussian_windows(points: Tensor, clouds: Tensor, count: int = len(WIDTHS)) -> list[Window]:
    """Return the first `count` windows, widest first, of (B, N, 3) clouds about (B, n, 3) points."""
    squares = (clouds[..., :, None] * clouds[..., None, :]).flatten(2)
    moments = torch.cat([torch.ones_like(clouds[..., :1]), clouds, squares], dim=2)  # (B, N, 13)
    windows = []
    for width, weights in zip(WIDTHS, _weights(points, clouds, count), strict=False):
        total, first, second = torch.split(weights @ moments, [1, 3, 9], dim=2)
        mean = first / total
        covariance = (second / total).reshape(*mean.shape, 3) - mean[..., :, None] * mean[..., None, :]
        values, axes = torch.linalg.eigh(covariance)
        density = 0.3 * (total / clouds.shape[1]).log()
        # The root of a flat neighbourhood's zero would be its rounding error's, many times greater.
        spreads = values.clamp(min=1e-12).sqrt() / width
        windows.append(Window((mean - points) / width, mean, spreads, axes, density))
    return windows


def _weights(points: Tensor, clouds: Tensor, count: int) -> list[Tensor]:
    """Return exp(-|x - y|^2 / 2 s^2) of every point and every point of its cloud, for each width s: (B, n, N)."""
    # |x - y|^2 = |x|^2 + |y|^2 - 2 x . y as one product: in float64 its rounding is nothing here.
    of_points, of_clouds = points.square().sum(dim=2, keepdim=True), clouds.square().sum(dim=2, keepdim=True)
    left = torch.cat([points, of_points, torch.ones_like(of_points)], dim=2)
    right = torch.cat([-2 * clouds, torch.ones_like(of_clouds), of_clouds], dim=2)
    weights = [(left @ right.transpose(1, 2)).mul_(-0.5 / WIDTHS[0] ** 2).exp_()]
    for _ in range(1, count):
        # Half the width is the fourth power: cheaper than another exponential.
        weights.append(weights[-1].square().square_())
    return weights


def _length(vectors: Tensor) -> Tensor:
    lengths: Tensor = torch.linalg.vector_norm(vectors, dim=2, keepdim=True)
    return lengths
