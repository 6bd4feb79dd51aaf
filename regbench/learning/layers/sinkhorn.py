"""Soft assignments between two clouds in which a point may stay without a partner."""

from __future__ import annotations

import torch
from torch import Tensor

# Between two exponentials factors grow by at most about (N + 1)^5: float32 holds that for ten million points.
STEPS_PER_KERNEL = 5


def log_sinkhorn(scores: Tensor, iterations: int, *, slack: bool = True) -> Tensor:
    """Return log assignments: exp(scores) with rows and columns scaled in turn, so that they sum to one.

    Sinkhorn (1964). With slack, as in RPM-Net (Yew and Lee 2020): one more row and column of score 0
    take what finds no partner. Every real row is scaled with its share in the slack column, every real column with
    its share in the slack row, and these two are not scaled themselves. Without, a square matrix becomes doubly
    stochastic. The columns are scaled last: theirs are the sums that are exact.

    Args:
        scores: (B, N, M) float32 or float64, finite, of any size.
        iterations: How often rows, then columns are scaled, at least once.
        slack: Whether the slack row and column are there.

    Returns:
        (B, N, M) of the same type, without the slack row and column; exp of it sums to at most one along both.

    Raises:
        ValueError: `scores` is not (B, N, M) or `iterations` is under 1.
    """
    if scores.ndim != 3 or iterations < 1:
        raise ValueError(
            f"log_sinkhorn needs (B, N, M) scores and iterations >= 1: {tuple(scores.shape)}, {iterations}"
        )
    return _with_slack(scores, iterations) if slack else _without_slack(scores, iterations)


def _without_slack(scores: Tensor, iterations: int) -> Tensor:
    for _ in range(iterations):
        scores = scores.log_softmax(dim=2).log_softmax(dim=1)
    return scores


def _with_slack(scores: Tensor, iterations: int) -> Tensor:
    """The same by log factors u of rows and v of columns (0 for the slack), with one exponential for five iterations.

    With each row's largest number made one in K = exp(scores + u + v), its slack counted, no sum below is near zero,
    and what K loses under the smallest number is nothing beside them. So a scaling is a product of K with a vector, a
    twentieth of the time of a logsumexp (Schmitzer 2019, absorption iteration).
    """
    scaled = scores
    v = scores.new_zeros((len(scores), 1, scores.shape[2]))
    for done in range(0, iterations, STEPS_PER_KERNEL):
        if done:
            scaled = scores + v
        highest = scaled.detach().amax(dim=2, keepdim=True).clamp_min(0)
        K, slack_column, slack_row = (scaled - highest).exp_(), (-highest).exp(), v.exp()
        columns = torch.ones_like(v)
        for _ in range(min(STEPS_PER_KERNEL, iterations - done)):
            rows = 1 / (K @ columns.transpose(1, 2) + slack_column)
            columns = 1 / (rows.transpose(1, 2) @ K + slack_row)
        u, v = rows.log() - highest, v + columns.log()
    return (scores + u).add_(v)  # in place: new memory costs more than the sum
