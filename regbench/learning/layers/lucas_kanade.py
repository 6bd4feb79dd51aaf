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

# Always added to the normal matrix's diagonal, as a share of its mean.
LEAST_DAMPING, TINY = 1e-6, 1e-12
# With descent: added to it as a share of itself, at first; and by what this changes after a good and a bad update.
FIRST_DAMPING, SMALLER, LARGER = 1e-2, 0.3, 5.0


def lucas_kanade(
    layers: Sequence[Layer],
    source: Tensor,
    target: Tensor,
    *,
    iterations: int,
    jacobian: Jacobian = "analytical",
    step: float = 1e-2,
    descent: bool = False,
    tolerance: float = 0.0,
    start: Tensor | None = None,
) -> tuple[list[Tensor], Tensor]:
    """Move the source until its features are the target's (Aoki et al. 2019).

    The source, moved by T, should be exp(-xi) target for a small xi: f(T source) = f(target) - J xi, with J the
    derivative of f(exp(X) target) at 0, computed once. So xi = J^+ (f(target) - f(T source)), and T becomes exp(xi) T.

    Args:
        layers: Of the PointNet f; see `PointNet.folded`.
        source: (B, N, 3) floating point.
        target: (B, M, 3).
        iterations: Most updates.
        jacobian: "analytical" (Li et al. 2021); or "numerical", from six more clouds, each twisted by `step`.
        step: Of "numerical", rad and the clouds' unit.
        descent: Whether an update that does not make the features' difference smaller is taken back, and the next
            one made smaller (Marquardt 1963); else every update counts, as in the papers.
        tolerance: Stop where no component of any xi is larger.
        start: The first T, (B, 4, 4); None: no motion.

    Returns:
        T_target_source after each update, (B, 4, 4) each; and the features' difference f(target) - f(T source), (B, K),
        of the motion before the last update; with `descent`, of the answer.

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
    diagonal = normal.diagonal(dim1=1, dim2=2)
    # Of a cloud on a line the features do not determine all six parameters.
    least = torch.diag_embed((LEAST_DAMPING * diagonal.mean(dim=1) + TINY)[:, None].expand(-1, 6))
    damping = torch.full_like(diagonal[:, :1], FIRST_DAMPING)
    T = torch.eye(4).to(source).repeat(len(source), 1, 1) if start is None else start
    residual = features - pooled(layers, source @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3])
    visited: list[Tensor] = []
    while True:
        damped = torch.diag_embed(damping * diagonal) if descent else 0.0
        factor = torch.linalg.cholesky(normal + least + damped)
        xi = torch.cholesky_solve(transposed @ residual[:, :, None], factor)[:, :, 0]
        moved = se3_exp(xi) @ T
        last = len(visited) == iterations - 1 or (tolerance > 0 and float(xi.detach().abs().max()) <= tolerance)
        if last and not descent:
            return [*visited, moved], residual
        residual_moved = features - pooled(layers, source @ moved[:, :3, :3].transpose(1, 2) + moved[:, None, :3, 3])
        if descent:
            better = residual_moved.square().sum(dim=1) < residual.square().sum(dim=1)
            moved = torch.where(better[:, None, None], moved, T)
            residual_moved = torch.where(better[:, None], residual_moved, residual)
            damping = torch.where(better[:, None], SMALLER * damping, LARGER * damping)
        T, residual = moved, residual_moved
        visited.append(T)
        if last:
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
    """Return the sum of squares of the entries of T truth^-1 - I for each motion (Aoki et al. 2019), (..., B).

    Args:
        T_target_source: (..., B, 4, 4).
        truth: (B, 4, 4).
    """
    off: Tensor = T_target_source @ torch.linalg.inv(truth) - torch.eye(4).to(truth)
    return off.square().sum(dim=(-1, -2))
