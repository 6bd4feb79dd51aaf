"""PointNetLK's network: a PointNet, and the loop that aligns its features."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from torch import Tensor

from regbench.learning.layers.lucas_kanade import lucas_kanade
from regbench.learning.layers.pointnet import PointNet
from regbench.learning.pair_network import Alignment, PairNetwork

# The paper's; PointNetLK Revisited has (64, 128, 1024).
WIDTHS = (64, 64, 64, 128, 1024)


class PointNetLkNetwork(PairNetwork):
    """The feature f of a cloud.

    Args:
        widths: Of the PointNet's layers.
        normalisation: Of each layer.
    """

    def __init__(self, *, widths: Sequence[int] = WIDTHS, normalisation: Literal["batch", "none"] = "batch") -> None:
        super().__init__()
        self.encoder = PointNet(widths, normalisation=normalisation)

    def align(self, source: Tensor, target: Tensor, **options: Any) -> Alignment:
        """Return the motions of a batch; see `PairNetwork.align`. Options are those of `lucas_kanade`."""
        visited, residual = lucas_kanade(self.encoder.folded(), source, target, **{"iterations": 10, **options})
        return Alignment(visited[-1], len(visited), -residual.square().mean(dim=1).sqrt())
