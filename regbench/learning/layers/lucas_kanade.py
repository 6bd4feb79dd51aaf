"""Inverse compositional Lucas-Kanade on PointNet features: PointNetLK's loop, and FMR's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import torch
from torch import Tensor

from regbench.learning.layers.pointnet import Layer, pooled
from regbench.learning.layers.pointnet_jacobian import pointnet_jacobian
from regbench.learning.layers.se3_exponential import se3_exp

Jacobian = Literal["analytical", "numerical"]

# Added to the normal matrix, as a share of its mean diagonal: a cloud on a line does not determine all six parameters.
DAMPING = 1e-6
TINY = 1e-12


def lucas_kanade(
    layers: Sequence[Layer],
    source: Tensor,
    target: Tensor,
    *,
    iterations: int,
    jacobian: Jacobian = "analytical",
    step: float = 1e-2,
    tolerance: float = 0.0,
) -> tuple[list[Tensor], Tensor]:
    """Move the source until its features are the target's (Aoki et al. 2019, Eq. 2 to 6).

    The source, moved by T, should be exp(-xi) target for a small xi: f(T source) = f(target) - J xi, with J the
    derivative of f(exp(X) target) at 0, computed once. So xi = J^+ (f(target) - f(T source)), and T becomes exp(xi) T.

    Args:
        layers: Of the PointNet f; see `PointNet.folded`.
        source: (B, N, 3) floating point.
        target: (B, M, 3).
        iterations: Most updates.
        jacobian: "analytical" (Li et al. 2021); or "numerical", from six more clouds, each twisted by `step`.
        step: Of "numerical", rad and the clouds' unit.
        tolerance: Stop where no component of any xi is larger.

    Returns:
        T_target_source after each update, (B, 4, 4) each; and the feature residual f(target) - f(T source) before the
        last update, (B, K).

    Raises:
        ValueError: `iterations` is less than 1.
    """
    if iterations < 1:
        raise ValueError(f"iterations must be at least 1, got {iterations}")
    if jacobian == "analytical":
        features, J = pointnet_jacobian(layers, target)
    else:
        features = pooled(layers, target)
        J = numerical_jacobian(layers, target, features, step)
    transposed = J.transpose(1, 2)
    normal = transposed @ J
    mean = normal.diagonal(dim1=1, dim2=2).mean(dim=1)
    factor = torch.linalg.cholesky(normal + torch.diag_embed((DAMPING * mean + TINY)[:, None].expand(-1, 6)))
    T = torch.eye(4).to(source).expand(len(source), 4, 4)
    visited: list[Tensor] = []
    for _ in range(iterations):
        moved = source @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3]
        residual = features - pooled(layers, moved)
        xi = torch.cholesky_solve(transposed @ residual[:, :, None], factor)[:, :, 0]
        T = se3_exp(xi) @ T
        visited.append(T)
        if tolerance > 0 and float(xi.detach().abs().max()) <= tolerance:
            break
    return visited, residual


def numerical_jacobian(layers: Sequence[Layer], points: Tensor, features: Tensor, step: float) -> Tensor:
    """Return the derivative of pooled(layers, exp(X) points) at X = 0 by forward differences, (B, K, 6).

    Args:
        layers: Of the PointNet.
        points: (B, N, 3).
        features: (B, K), those of the points.
        step: Size of each twist, rad and the points' unit.
    """
    columns = []
    for twist in step * torch.eye(6).to(points):
        T = se3_exp(twist[None])[0]
        columns.append((pooled(layers, points @ T[:3, :3].T + T[:3, 3]) - features) / step)
    return torch.stack(columns, dim=2)


def pose_loss(T_target_source: Tensor, truth: Tensor) -> Tensor:
    """Return the mean square of the entries of T truth^-1 - I (Aoki et al. 2019, Eq. 8, as a mean of 16).

    Args:
        T_target_source: (..., 4, 4).
        truth: (B, 4, 4), broadcast over the first axes.
    """
    loss: Tensor = (T_target_source @ torch.linalg.inv(truth) - torch.eye(4).to(truth)).square().mean()
    return loss
