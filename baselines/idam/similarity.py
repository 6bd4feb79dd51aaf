"""IDAM's similarity matrix convolution: how well each source point goes with each target point."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

# Numbers of a pair that are worked on at once where no gradient is kept: they stay in the cache.
BLOCK = 8192


class Points(NamedTuple):
    """Points and their features.

    Attributes:
        xyz: (B, N, 3).
        features: (B, N, width).
    """

    xyz: Tensor
    features: Tensor


class SimilarityConvolution(nn.Module):
    """1 x 1 convolutions on pairs of points, and the validity of a source point.

    A pair's features are those of its two points, their distance, and the direction from the target's to the
    source's. The first layer is linear in them: it is the sum of a part of each source point, one of each target point,
    and one of the numbers of the geometry, so that the (N x M x 132) array is never made. No BatchNorm (ours).

    Args:
        features: Channels of a point.
        width: Channels of a pair.
        compared: Whether a pair also has the mean squared difference of its features (ours).
    """

    def __init__(self, *, features: int, width: int, compared: bool) -> None:
        super().__init__()
        self.compared = compared
        self.pair = nn.Linear(2 * features + (5 if compared else 4), width)
        self.hidden = nn.Linear(width, width)
        self.score: nn.Module = nn.Linear(width, 1)
        self.validity = nn.Sequential(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 1))
        nn.init.kaiming_normal_(self.hidden.weight)

    def forward(self, source: Points, target: Points) -> tuple[Tensor, Tensor]:
        """Return scores (B, N, M), whose softmax along M is the similarity matrix, and validity logits (B, N)."""
        scores, pooled = self._rows(source, self._of_source(source), target, self._of_target(target))
        return scores, self.validity(pooled)[:, :, 0]

    def match(self, source: Points, target: Points) -> tuple[Tensor, Tensor]:
        """Return the best target of each source point, (B, N) int64, and the points' validity, (B, N) in [0, 1].

        As `forward`, without its (N x M) arrays, and without gradients.
        """
        of_source, of_target = self._of_source(source), self._of_target(target)
        rows = max(1, BLOCK // (len(source.xyz) * target.xyz.shape[1]))
        best, pooled = [], []
        for first in range(0, source.xyz.shape[1], rows):
            some = slice(first, first + rows)
            points = Points(source.xyz[:, some], source.features[:, some])
            scores, highest = self._rows(points, of_source[:, some], target, of_target)
            best.append(scores.argmax(dim=2))
            pooled.append(highest)
        return torch.cat(best, dim=1), self.validity(torch.cat(pooled, dim=1))[:, :, 0].sigmoid()

    def _of_source(self, points: Points) -> Tensor:
        """Return the first layer's part of source points, with the bias."""
        channels = points.features.shape[2]
        return functional.linear(points.features, self.pair.weight[:, :channels], self.pair.bias)

    def _of_target(self, points: Points) -> Tensor:
        """Return the first layer's part of target points."""
        channels = points.features.shape[2]
        return functional.linear(points.features, self.pair.weight[:, channels : 2 * channels])

    def _rows(self, source: Points, of_source: Tensor, target: Points, of_target: Tensor) -> tuple[Tensor, Tensor]:
        """Return scores (B, rows, M) and the maxima of the pairs' channels over M, (B, rows, width)."""
        numbers = _geometry(source.xyz, target.xyz)
        if self.compared:
            numbers = torch.cat([numbers, _difference(source.features, target.features)], dim=3)
        pairs = functional.linear(numbers, self.pair.weight[:, -numbers.shape[3] :])
        pairs = pairs.add_(of_source[:, :, None]).add_(of_target[:, None]).relu_()
        pairs = self.activated(self.hidden(pairs))
        return self.score(pairs)[:, :, :, 0], pairs.amax(dim=2)

    def activated(self, pairs: Tensor) -> Tensor:
        """Return the activation of the pairs' last channels, in place."""
        return pairs.relu_()


def _geometry(source: Tensor, target: Tensor) -> Tensor:
    """Return distance and direction of pairs, (B, N, M, 4); no direction where two points coincide."""
    offsets = source[:, :, None] - target[:, None]
    distances = torch.linalg.vector_norm(offsets, dim=3, keepdim=True)
    return torch.cat([distances, offsets / distances.clamp_min(torch.finfo(offsets.dtype).tiny)], dim=3)


def _difference(source: Tensor, target: Tensor) -> Tensor:
    """Return the mean squared difference of pairs of features, (B, N, M, 1)."""
    squares = source.square().sum(dim=2)[:, :, None] + target.square().sum(dim=2)[:, None]
    return torch.baddbmm(squares, source, target.transpose(1, 2), alpha=-2)[:, :, :, None] / source.shape[2]
