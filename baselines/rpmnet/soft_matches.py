"""Soft matches between two clouds, and all that is taken from them, without the (N x M) matrices of autograd."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

ITERATIONS = 5


def soft_matches(source: Tensor, target: Tensor, offset: Tensor, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Match two clouds by scores <source, target> + offset and five Sinkhorn iterations with slack.

    The matches are P = exp(log_sinkhorn(scores, 5)) of `regbench.learning.layers.sinkhorn`, which is
    diag(rows) K diag(columns) with K = exp(scores): neither P nor any other matrix of its size is made beside K. Each
    use of K in the forward pass adds an outer product to its gradient; they are summed as one product of thin matrices.

    Args:
        source: (B, N, C) features of source points, scaled.
        target: (B, M, C) features of target points.
        offset: (B,).
        points: (B, M, 3), the target's points. Receive no gradient.

    Returns:
        P @ points (B, N, 3), the sums of P's rows (B, N) and of its columns (B, M).
    """
    sums, columns = _SoftMatches.apply(source, target, offset, functional.pad(points, (0, 1), value=1.0))  # type: ignore[no-untyped-call]  # torch's own
    return sums[:, :, :3], sums[:, :, 3], columns


class _SoftMatches(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, source: Tensor, target: Tensor, offset: Tensor, values: Tensor) -> tuple[Tensor, Tensor]:
        tensors = (source, target, offset[:, None, None], values)
        found = [_forward(*piece) for piece in zip(*(_pieces(each) for each in tensors), strict=True)]
        ctx.save_for_backward(source, target, values)
        ctx.kept = [kept for _, _, kept in found] if any(ctx.needs_input_grad) else None
        return torch.cat([sums for sums, _, _ in found]), torch.cat([columns for _, columns, _ in found])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        source, target, values, *of_outputs = (_pieces(each) for each in (*ctx.saved_tensors, *gradients))
        found = [_backward(*piece) for piece in zip(source, target, values, ctx.kept, *of_outputs, strict=True)]
        return *(torch.cat(each) for each in zip(*found, strict=True)), None


def _pieces(batch: Tensor) -> tuple[Tensor, ...]:
    """Return what is computed at once: on a CPU pair by pair, so that one K stays in the cache."""
    return torch.split(batch, 1 if batch.device.type == "cpu" else len(batch))


def _forward(
    source: Tensor, target: Tensor, offset: Tensor, values: Tensor
) -> tuple[Tensor, Tensor, tuple[Tensor, list[Tensor], list[Tensor]]]:
    K = torch.baddbmm(offset, source, target.mT)
    # The largest number of each row of K is one, its slack counted, so that no sum below is near zero.
    highest = K.amax(dim=2, keepdim=True).clamp_min_(0)
    slack = (-highest).exp()
    K.sub_(highest).exp_()
    rows: list[Tensor] = []
    columns = [torch.ones_like(values[:, :, :1])]
    for _ in range(ITERATIONS):
        rows.append(1 / (K @ columns[-1] + slack))
        columns.append(1 / (K.mT @ rows[-1] + 1))
    sums = rows[-1] * (K @ (columns[-1] * values))
    # The last scaling made each column's sum and its slack one.
    return sums, 1 - columns[-1][:, :, 0], (K, rows, columns)


def _backward(
    source: Tensor,
    target: Tensor,
    values: Tensor,
    kept: tuple[Tensor, list[Tensor], list[Tensor]],
    of_sums: Tensor,
    of_column_sums: Tensor,
) -> tuple[Tensor, Tensor, Tensor]:
    K, rows, columns = kept
    weighted, scaled = rows[-1] * of_sums, columns[-1] * values
    # The gradient of K is left @ right.mT.
    left, right = [weighted], [scaled]
    of_rows = (of_sums * (K @ scaled)).sum(dim=2, keepdim=True)
    of_columns = (K.mT @ weighted * values).sum(dim=2, keepdim=True) - of_column_sums[:, :, None]
    for row, column, before in zip(reversed(rows), reversed(columns[1:]), reversed(columns[:-1]), strict=True):
        of_products = -of_columns * column.square()
        left.append(row)
        right.append(of_products)
        of_rows = of_rows + K @ of_products
        of_products = -of_rows * row.square()
        left.append(of_products)
        right.append(before)
        of_columns = K.mT @ of_products
        of_rows = torch.zeros_like(of_rows)
    of_scores = (torch.cat(left, dim=2) @ torch.cat(right, dim=2).mT).mul_(K)
    return of_scores @ target, of_scores.mT @ source, of_scores.sum(dim=(1, 2))
