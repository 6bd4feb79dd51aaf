"""A linear layer and the maximum over points in one: only the winners have a gradient."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional


def linear_max(points: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Return the maximum over points of W x + b, as (points @ weight.T + bias).amax(dim=1) does.

    Of the B N C values that the layer makes, B C are a maximum. The backward pass goes through these alone: it costs
    as much as that of one layer on C points, whatever N. The gradient goes to one point among equals.

    Args:
        points: (B, N, F) floating point, N >= 1.
        weight: (C, F).
        bias: (C,).

    Returns:
        (B, C).
    """
    highest: Tensor = _LinearMax.apply(points, weight, bias)  # type: ignore[no-untyped-call]  # torch's own
    return highest


class _LinearMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, points: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        # Cloud by cloud: its values stay in the cache, and are never all in memory.
        found = [functional.linear(cloud, weight).max(dim=0) for cloud in points]
        highest, winners = (torch.stack([each[part] for each in found]) for part in (0, 1))
        ctx.save_for_backward(points, weight, winners)
        return highest + bias

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        points, weight, winners = ctx.saved_tensors
        (gradient,) = gradients  # (B, C)
        index = winners[:, :, None].expand(-1, -1, points.shape[2])  # (B, C, F)
        of_weight = (gradient[:, :, None] * points.gather(1, index)).sum(dim=0)
        of_points = torch.zeros_like(points).scatter_add_(1, index, gradient[:, :, None] * weight)
        return of_points, of_weight, gradient.sum(dim=0)
