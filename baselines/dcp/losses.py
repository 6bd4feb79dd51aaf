"""DCP's loss of the motion, and ours of the matches."""

from __future__ import annotations

import torch
from torch import Tensor

from regbench.learning.layers.weighted_kabsch import weighted_kabsch

from .network import DcpNetwork, log_matches


def dcp_losses(network: DcpNetwork, batch: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return "pose", |R^T R_gt - I|^2 + |t - t_gt|^2 (the paper's, mean of a batch), and "matching" (ours).

    "matching" is the mean cross-entropy of the matches and the target point nearest to where a source point belongs.
    """
    source, target, truth = batch["source"], batch["target"], batch["T_target_source"]
    logarithms = log_matches(*network.embeddings(source, target))
    T = weighted_kabsch(source, logarithms.exp() @ target)
    turned = T[:, :3, :3].transpose(1, 2) @ truth[:, :3, :3] - torch.eye(3).to(T)
    shifted = T[:, :3, 3] - truth[:, :3, 3]
    belongs = source @ truth[:, :3, :3].transpose(1, 2) + truth[:, None, :3, 3]
    with torch.no_grad():
        partner = torch.cdist(belongs, target, compute_mode="donot_use_mm_for_euclid_dist").argmin(dim=2)
    return {
        "pose": (turned.square().sum(dim=(1, 2)) + shifted.square().sum(dim=1)).mean(),
        "matching": -logarithms.gather(2, partner[:, :, None]).mean(),
    }
