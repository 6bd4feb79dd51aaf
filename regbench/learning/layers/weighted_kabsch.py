"""The best rotation and motion for weighted matches, with gradients that stay finite where the best is not unique."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional


def weighted_kabsch(source: Tensor, target: Tensor, weights: Tensor | None = None) -> Tensor:
    """Return the rigid motions that minimise the weighted squared distances of matched points.

    Kabsch (1976), as `regbench.geometry.kabsch`, in batches and with gradients for points and weights. Values and
    gradients are finite for every finite input, also where the points do not determine the rotation: one of the best
    is returned, and what is not determined receives no gradient. Weights whose sum is nothing (under 4e-10 in
    float32, 1e-77 in float64) give the identity as they go to zero.

    Args:
        source: (B, N, 3) float32 or float64 points, N >= 1.
        target: (B, N, 3) points; row i matches row i of `source`.
        weights: (B, N) weights that are not negative, of any sum, or None for equal ones.

    Returns:
        T_target_source, (B, 4, 4) of the same type.
    """
    if weights is None:
        source_mean, target_mean = source.mean(dim=1, keepdim=True), target.mean(dim=1, keepdim=True)
        weighted = (target - target_mean) / source.shape[1]
    else:
        # The fourth root: the product of this floor's gradient with that of a tiny covariance does not overflow.
        shares = weights / weights.sum(dim=1, keepdim=True).clamp_min(torch.finfo(weights.dtype).tiny ** 0.25)
        source_mean, target_mean = shares[:, None] @ source, shares[:, None] @ target
        weighted = (target - target_mean) * shares[:, :, None]
    R = rotation_of_covariance(weighted.transpose(1, 2) @ (source - source_mean))
    t = target_mean.transpose(1, 2) - R @ source_mean.transpose(1, 2)
    T = functional.pad(torch.cat([R, t], dim=2), (0, 0, 0, 1))
    T[:, 3, 3] = 1
    return T


def rotation_of_covariance(H: Tensor) -> Tensor:
    """Return the rotations R that maximise trace(R^T H): the nearest ones to H.

    With H = sum over i of w_i y_i x_i^T (target times source, both centred) R maps source to target. With
    H = U S V^T, R = U D V^T and D = diag(1, 1, d), d = det(U V^T) (Umeyama 1991, Eq. 43).

    The gradient needs no differences of singular values (Papadopoulo and Lourakis 2000; Levinson et al. 2020):
    P = R^T H is symmetric with eigenvalues s = (s1, s2, d s3) in the basis V. From dH = dR P + R dP and
    dR = R W, W skew: R^T dH - dH^T R = W P + P W, that is, in the basis V, W_ij (s_i + s_j). Transposed, a gradient
    G of R gives H the gradient U D [(A - A^T)_ij / (s_i + s_j)] V^T with A = D U^T G V. Where s_i + s_j is nothing
    beside s1 (64 machine epsilons), all turns in the plane ij are equally good: that turn gets no gradient.

    Args:
        H: (B, 3, 3) float32 or float64.

    Returns:
        (B, 3, 3) of the same type, each with determinant 1. Differentiable once.
    """
    R: Tensor = _RotationOfCovariance.apply(H)  # type: ignore[no-untyped-call]  # torch's own
    return R


class _RotationOfCovariance(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, H: Tensor) -> Tensor:
        U, _, Vt = torch.linalg.svd(H)
        # Both made rotations, so that their product is U D V^T: half the time of a determinant and its sign.
        U[:, :, 2] = torch.linalg.cross(U[:, :, 0], U[:, :, 1])
        Vt[:, 2] = torch.linalg.cross(Vt[:, 0], Vt[:, 1])
        ctx.save_for_backward(H, U, Vt)
        R: Tensor = U @ Vt
        return R

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> Tensor:
        H, U, Vt = ctx.saved_tensors  # H = U diag(s) V^T, U and V rotations: D is in them
        (G,) = gradients
        V = Vt.transpose(1, 2)
        s = (U * (H @ V)).sum(dim=1)  # with the sign d of the last one
        A = U.transpose(1, 2) @ G @ V
        sums = s[:, :, None] + s[:, None, :]
        kind = torch.finfo(s.dtype)
        least = (64 * kind.eps * s[:, :1, None]).clamp_min(kind.tiny**0.5)
        turns = torch.where(sums > least, (A - A.transpose(1, 2)) / sums.maximum(least), 0)
        of_H: Tensor = U @ turns @ Vt
        return of_H
