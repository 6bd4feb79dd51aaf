"""The maximum over each point's neighbours, without the (points x neighbours x channels) array in memory."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor


def neighbour_max(values: Tensor, neighbours: Tensor) -> Tensor:
    """Return, for every point and channel, the maximum of the values at the point's neighbours.

    The gradient goes to the winner alone (the first one in `neighbours` among equals), whose index is all that is
    kept for the backward pass. On the CPU in float32 both passes are compiled loops; elsewhere they are torch's, one
    neighbour at a time.

    Args:
        values: (B, N, C) floating point.
        neighbours: (B, M, k) int64 indices into the N points, k >= 1.

    Returns:
        (B, M, C) of the type of `values`.

    Raises:
        ValueError: The shapes do not fit, or an index is out of range.
    """
    if values.ndim != 3 or neighbours.ndim != 3 or len(values) != len(neighbours) or neighbours.shape[2] == 0:
        raise ValueError(
            f"neighbour_max needs (B, N, C) values and (B, M, k >= 1) neighbours: {tuple(values.shape)}, "
            f"{tuple(neighbours.shape)}"
        )
    maximum: Tensor = _NeighbourMax.apply(values, neighbours)  # type: ignore[no-untyped-call]  # torch's own
    return maximum


class _NeighbourMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, neighbours: Tensor) -> Tensor:
        compiled = values.device.type == "cpu" and values.dtype == torch.float32
        maximum, winners = (_forward_compiled if compiled else _forward_torch)(values, neighbours)
        ctx.save_for_backward(winners)
        ctx.shape, ctx.compiled = values.shape, compiled
        return maximum

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (winners,) = ctx.saved_tensors
        (gradient,) = gradients
        spread = gradient.new_zeros(ctx.shape)
        if ctx.compiled:
            _backward_compiled(gradient, winners, spread)
        else:
            spread.scatter_add_(1, winners, gradient)
        return spread, None


def _forward_torch(values: Tensor, neighbours: Tensor) -> tuple[Tensor, Tensor]:
    shape = (*neighbours.shape[:2], values.shape[2])
    maximum = winners = None
    for index in neighbours.unbind(dim=2):
        index = index[:, :, None].expand(shape)
        candidate = values.gather(1, index)
        if maximum is None or winners is None:
            maximum, winners = candidate, index
        else:
            better = candidate > maximum
            maximum, winners = torch.where(better, candidate, maximum), torch.where(better, index, winners)
    assert maximum is not None  # neighbour_max refuses k = 0
    assert winners is not None
    return maximum, winners


def _forward_compiled(values: Tensor, neighbours: Tensor) -> tuple[Tensor, Tensor]:
    if int(neighbours.min()) < 0 or int(neighbours.max()) >= values.shape[1]:  # compiled loops do not look
        raise ValueError(f"neighbour_max: an index is outside the {values.shape[1]} points")
    maximum = values.new_empty((*neighbours.shape[:2], values.shape[2]))
    winners = torch.empty(maximum.shape, dtype=torch.int32)
    from regbench.learning.layers.neighbour_max_loops import forward
    from regbench.learning.layers.threads import as_many_as_torch

    with as_many_as_torch():
        forward(values.detach().contiguous().numpy(), neighbours.contiguous().numpy(), maximum.numpy(), winners.numpy())
    return maximum, winners


def _backward_compiled(gradient: Tensor, winners: Tensor, spread: Tensor) -> None:
    from regbench.learning.layers.neighbour_max_loops import backward
    from regbench.learning.layers.threads import as_many_as_torch

    with as_many_as_torch():
        backward(gradient.contiguous().numpy(), winners.numpy(), spread.numpy())
