"""RPM-Net's losses."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from .network import Step

DISCOUNT = 0.5


def training_losses(
    steps: Sequence[Step], source: Tensor, T_target_source: Tensor, inlier_weight: float
) -> dict[str, Tensor]:
    """Return the weighted terms, each summed over iterations, the last with weight 1, the one before 1/2, and so on.

    "registration": the mean L1 distance of the source's points moved by the answer and by the truth.
    "inliers": minus the matched shares of points, of both clouds, plus one for each.

    Args:
        steps: The iterations.
        source: (B, N, 3).
        T_target_source: (B, 4, 4), the truth.
        inlier_weight: The paper's lambda, 0.01.
    """
    truth = _moved(T_target_source, source)
    registration, inliers = source.new_zeros(()), source.new_zeros(())
    for step in steps:
        distance = (_moved(step.T_target_source, source) - truth).abs().mean()
        registration = DISCOUNT * registration + distance
        inliers = DISCOUNT * inliers + (1 - step.source_shares.mean()) + (1 - step.target_shares.mean())
    return {"registration": registration, "inliers": inlier_weight * inliers}


def _moved(T: Tensor, points: Tensor) -> Tensor:
    return points @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3]
