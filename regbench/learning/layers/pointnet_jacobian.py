"""The derivative of PointNet's pooled features when the cloud moves: analytical, for the winning points alone."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from regbench.learning.layers.pointnet import Layer, winning_points


def pointnet_jacobian(layers: Sequence[Layer], points: Tensor) -> tuple[Tensor, Tensor]:
    """Return PointNet's features of clouds and their derivative by a twist of the clouds.

    d/dX of pooled(layers, exp(X) points) at X = 0 (Li et al. 2021, PointNetLK Revisited, without their cut into
    parts). A feature is that of one point x, which wins its maximum: its derivative by X is g^T [-[x]_x, I], g the
    gradient of the feature at x. The points that win, a few hundred for a thousand features, are carried forward
    once with the hidden layers' derivatives; the last layer is evaluated for each feature at its winner only. All of
    it has gradients for the layers and the points.

    Args:
        layers: Weights (C_out, C_in) and biases (C_out,), ReLU after each, as of `PointNet.folded`.
        points: (B, N, 3) floating point.

    Returns:
        Features, (B, K), and Jacobians, (B, K, 6), columns in the order of `se3_exp`: rotation, then translation.
    """
    *hidden, (last_weight, last_bias) = layers
    x, of_feature = winning_points(layers, points)  # (P, 3)
    values, slopes = x, torch.eye(3).to(points)[None]  # row i of a slope: the derivative of `values` by x_i
    for weight, bias in hidden:
        values = functional.linear(values, weight, bias).relu()
        slopes = functional.linear(slopes, weight) * (values > 0)[:, None]
    # Each feature's row of the last layer with its winner's values and slopes: (B, K, 4, C).
    both = torch.cat([values[:, None], slopes.expand(len(x), -1, -1)], dim=1)[of_feature]
    at_winner = torch.einsum("bkrc,kc->bkr", both, last_weight)
    features = (at_winner[:, :, 0] + last_bias).relu()
    g = at_winner[:, :, 1:] * (features > 0)[:, :, None]
    return features, torch.cat([torch.linalg.cross(x[of_feature], g), g], dim=2)
