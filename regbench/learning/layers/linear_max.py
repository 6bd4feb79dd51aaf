"""A linear layer and the maximum over points in one: only the winners have a gradient."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

# Channels of a layer that are made and searched at a time.
CHANNELS = 256
NUMPY_TYPES = (torch.float32, torch.float64)


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


def linear_winners(points: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Return the maximum over points of W x, and which point has it, without gradients.

    Args:
        points: (B, N, F) floating point, B >= 1 and N >= 1.
        weight: (C, F).

    Returns:
        The maxima, (B, C), and the points' indices, (B, C) int64.
    """
    with torch.no_grad():
        if points.device.type != "cpu" or points.dtype not in NUMPY_TYPES:
            highest, winners = functional.linear(points, weight).max(dim=1)
            return highest, winners
        # Cloud by cloud, some channels at a time: the values stay in the cache and are never all in memory. A channel
        # is a row of them, and numpy's search for the place of its maximum takes a tenth of torch's time.
        found = [_winners(cloud, part) for cloud in points for part in torch.split(weight, CHANNELS)]
        highest, winners = (torch.cat([each[i] for each in found]).view(len(points), -1) for i in (0, 1))
        return highest, winners


def _winners(points: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Return the maxima of W x over (N, F) points, (C,), and the points' indices."""
    values = functional.linear(weight, points)
    winners = torch.from_numpy(values.numpy().argmax(axis=1))
    return values.gather(1, winners[:, None])[:, 0], winners


class _LinearMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, points: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        highest, winners = linear_winners(points, weight)
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
