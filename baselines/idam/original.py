"""IDAM with its authors' layers, for their weights."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from regbench.learning.layers.neighbours import nearest_neighbours

from .network import IdamNetwork
from .similarity import SimilarityConvolution


class OriginalGraphLayer(nn.Module):
    """max over j in kNN(i) of two layers on x_j - x_i, and a layer on points.

    Args:
        in_channels: Channels of a point.
        out_channels: Channels of the answer.
    """

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.first = nn.Linear(in_channels, out_channels)
        self.second = nn.Linear(out_channels, out_channels)
        self.point = nn.Linear(out_channels, out_channels)

    def forward(self, features: Tensor, neighbours: Tensor) -> Tensor:
        """Map (B, N, in_channels) to (B, N, out_channels) on the graph of (B, N, k) int64 neighbours."""
        batch = torch.arange(len(features), device=features.device)[:, None, None]
        products = functional.linear(features, self.first.weight)
        edges = (products[batch, neighbours] - products[:, :, None] + self.first.bias).relu_()
        answer: Tensor = self.point(self.second(edges).amax(dim=2))
        return answer


class OriginalPointFeatures(nn.Module):
    """Five such layers on the 12 nearest neighbours in xyz.

    Args:
        width: Channels.
        k: Neighbours, the point itself counted.
    """

    def __init__(self, *, width: int, k: int = 12) -> None:
        super().__init__()
        self.k = k
        self.layers = nn.ModuleList(
            OriginalGraphLayer(first, second) for first, second in ((3, 64), (64, 64), (64, 64), (64, 64), (64, width))
        )

    def forward(self, points: Tensor) -> Tensor:
        """Map (B, N, 3) points to (B, N, width) features."""
        neighbours = nearest_neighbours(points, self.k)
        features = points
        for layer in self.layers:
            features = layer(features, neighbours)
        return features


class OriginalSimilarity(SimilarityConvolution):
    """The similarity matrix convolution with two layers to the scores, and no activation of the pairs' last channels.

    Args:
        features: Channels of a point.
        width: Channels of a pair.
    """

    def __init__(self, *, features: int, width: int) -> None:
        super().__init__(features=features, width=width, compared=False)
        self.score = nn.Sequential(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 1))

    def activated(self, pairs: Tensor) -> Tensor:
        """Return the pairs' channels as they are."""
        return pairs


class OriginalIdam(IdamNetwork):
    """IDAM by its authors' layers. BatchNorm is a part of them (`renamed_original`), so it is not for training.

    Args:
        width: Channels of a point.
        pair_width: Channels of a pair of points.
        iterations: Iterations, each with weights of its own.
    """

    def __init__(self, *, width: int = 64, pair_width: int = 32, iterations: int = 3) -> None:
        super().__init__(width=width, pair_width=pair_width, iterations=iterations)
        self.points = OriginalPointFeatures(width=width)  # type: ignore[assignment]  # maps the same shapes
        self.significance = nn.Sequential(
            nn.Linear(width, 64), nn.ReLU(), nn.Linear(64, 32), nn.ReLU(), nn.Linear(32, 1)
        )
        self.similarities = nn.ModuleList(
            OriginalSimilarity(features=width, width=pair_width) for _ in range(iterations)
        )
