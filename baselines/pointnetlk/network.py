"""PointNetLK's network: a PointNet, and the loop that aligns its features."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Any, Literal

import torch
from torch import Tensor

from regbench.learning.layers.lucas_kanade import lucas_kanade
from regbench.learning.layers.pointnet import PointNet
from regbench.learning.layers.se3_exponential import se3_exp
from regbench.learning.pair_network import Alignment, PairNetwork

# The paper's; PointNetLK Revisited has (64, 128, 1024).
WIDTHS = (64, 64, 64, 128, 1024)
# The mean of the benchmark's angles, 0 to 45 degrees about each axis, with R = Rx Ry Rz: what training pairs turn by.
TRAINED_MEAN_RAD = radians(22.5)


class PointNetLkNetwork(PairNetwork):
    """The feature f of a cloud.

    Args:
        widths: Of the PointNet's layers.
        normalisation: Of each layer.
    """

    def __init__(self, *, widths: Sequence[int] = WIDTHS, normalisation: Literal["batch", "none"] = "batch") -> None:
        super().__init__()
        self.encoder = PointNet(widths, normalisation=normalisation)

    def align(self, source: Tensor, target: Tensor, *, from_mean: bool = True, **options: Any) -> Alignment:
        """Return the motions of a batch; see `PairNetwork.align`.

        Args:
            source: (B, N, 3).
            target: (B, M, 3).
            from_mean: Whether the loop runs a second time, from the mean rotation of the benchmark's motions; of the
                two ends the one whose features are nearer to the target's is the answer.
            options: Those of `lucas_kanade`.
        """
        layers = self.encoder.folded()
        every = {"iterations": 30, "descent": True, **options}
        visited, residual = lucas_kanade(layers, source, target, **every)
        T, difference, iterations = visited[-1], residual.square().mean(dim=1), len(visited)
        if from_mean:
            angle = torch.tensor([TRAINED_MEAN_RAD, 0.0, 0.0, 0.0, 0.0, 0.0]).to(source)
            about_x, about_y, about_z = (se3_exp(angle.roll(axis)[None]) for axis in range(3))
            start = (about_x @ about_y @ about_z).expand(len(source), 4, 4)
            visited, residual = lucas_kanade(layers, source, target, start=start, **every)
            nearer = residual.square().mean(dim=1) < difference
            T = torch.where(nearer[:, None, None], visited[-1], T)
            difference = torch.where(nearer, residual.square().mean(dim=1), difference)
            iterations += len(visited)
        return Alignment(T, iterations, -difference.sqrt())
