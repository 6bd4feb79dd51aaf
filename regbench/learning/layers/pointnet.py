"""PointNet: one small network for every point of a cloud, and the maximum over the points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, Literal

import torch
from torch import Tensor, nn
from torch.nn import functional

from regbench.learning.layers.linear_max import linear_winners

Layer = tuple[Tensor, Tensor]


class PointNet(nn.Module):
    """max over points of layers of ReLU(BatchNorm(W x + b)) (Qi et al. 2017), without the T-nets.

    Every layer, the last one too, has its BatchNorm and ReLU, as in PointNetLK. In evaluation mode BatchNorm is a
    part of the linear layers (`folded`); in training mode its statistics are those of all points of the batch.

    Args:
        widths: Channels after each layer; the last is the size of the answer.
        normalisation: "batch" or "none".
        in_channels: Channels of a point.
    """

    def __init__(
        self, widths: Sequence[int], *, normalisation: Literal["batch", "none"] = "batch", in_channels: int = 3
    ) -> None:
        super().__init__()
        # Any: torch's types know the elements as modules only.
        self.linear: Iterable[Any] = nn.ModuleList(nn.Linear(*sizes) for sizes in pairwise([in_channels, *widths]))
        self.norms: Iterable[Any] = nn.ModuleList(nn.BatchNorm1d(width) for width in widths if normalisation == "batch")

    def forward(self, points: Tensor) -> Tensor:
        """Map (B, N, in_channels) to (B, widths[-1])."""
        if not (self.training and self.norms):
            return pooled(self.folded(), points)
        features: Tensor = self.features(points).max(dim=1).values  # amax would share a gradient among equals
        return features

    def features(self, points: Tensor) -> Tensor:
        """Map (B, N, in_channels) to each point's features before the maximum, (B, N, widths[-1])."""
        if not (self.training and self.norms):
            return per_point(self.folded(), points)
        rows = points.flatten(0, 1)
        for linear, norm in zip(self.linear, self.norms, strict=True):
            rows = norm(linear(rows)).relu()
        return rows.view(*points.shape[:2], -1)

    def folded(self) -> list[Layer]:
        """Return each layer's weight (C_out, C_in) and bias (C_out,), BatchNorm by its running statistics in them.

        They have gradients for the parameters. A caller who encodes many clouds calls this once, then `pooled`.
        """
        layers = [(linear.weight, linear.bias) for linear in self.linear]
        if not self.norms:
            return layers
        scales = [norm.weight * (norm.running_var + norm.eps).rsqrt() for norm in self.norms]
        return [
            (weight * scale[:, None], torch.addcmul(norm.bias, bias - norm.running_mean, scale))
            for (weight, bias), scale, norm in zip(layers, scales, self.norms, strict=True)
        ]


def update_statistics(encoder: PointNet, clouds: Tensor) -> None:
    """Let BatchNorm's running statistics follow (B, N, C) clouds, and leave the encoder in evaluation mode.

    For losses through a loop that runs in evaluation mode, as PointNetLK's does (Aoki et al. 2019).
    """
    encoder.train()
    with torch.no_grad():
        encoder.features(clouds)
    encoder.eval()


def per_point(layers: Sequence[Layer], points: Tensor) -> Tensor:
    """Map (B, N, C) points to ReLU(W x + b) of one layer after the other, (B, N, K)."""
    for weight, bias in layers:
        points = functional.linear(points, weight, bias).relu_()
    return points


def pooled(layers: Sequence[Layer], points: Tensor) -> Tensor:
    """Return the maximum over points of `per_point`, (B, K), without the last layer's features in memory.

    Gradients go through the points that win a maximum alone, a few hundred for a thousand features: these are found
    without gradients, and carried forward once more with them.
    """
    *hidden, (weight, bias) = layers
    if torch.is_grad_enabled():
        chosen, of_feature = winning_points(layers, points)
        values = per_point(hidden, chosen)
        # A product and a sum: half the time of that many small matrix products.
        return ((values[of_feature] * weight).sum(dim=2) + bias).relu()
    features = per_point(hidden, points)
    if features.device.type == "cpu":  # cloud by cloud: one cloud's values stay in the cache
        highest = torch.stack([functional.linear(cloud, weight).amax(dim=0) for cloud in features])
    else:
        highest = functional.linear(features, weight).amax(dim=1)
    # ReLU and the bias keep the order: they follow the maximum.
    return highest.add_(bias).relu_()


def winning_points(layers: Sequence[Layer], points: Tensor) -> tuple[Tensor, Tensor]:
    """Return the points that win a maximum, (P, C), and which of them wins each feature, (B, K) int64."""
    *hidden, (weight, _) = layers
    with torch.no_grad():
        winners = linear_winners(per_point(hidden, points), weight)[1]
        winners += points.shape[1] * torch.arange(len(points), device=points.device)[:, None]
        chosen, of_feature = torch.unique(winners, return_inverse=True)
    return points.flatten(0, 1)[chosen], of_feature
