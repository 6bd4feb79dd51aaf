"""FMR's network in training: PointNetLK's, and a decoder beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from torch import Tensor, nn

from ..pointnetlk.network import WIDTHS, PointNetLkNetwork

# Of the decoder's layers between the feature and the points.
DECODER_WIDTHS = (1024, 512, 256)


class FmrNetwork(PointNetLkNetwork):
    """The feature of a cloud, and what a cloud is rebuilt from.

    Args:
        points: Points that the decoder answers.
        widths: Of the encoder's layers.
        normalisation: Of each of them.
    """

    def __init__(
        self,
        points: int,
        *,
        widths: Sequence[int] = WIDTHS,
        normalisation: Literal["batch", "none"] = "batch",
    ) -> None:
        super().__init__(widths=widths, normalisation=normalisation)
        layers: list[nn.Module] = []
        size = widths[-1]
        for width in DECODER_WIDTHS:
            layers += [nn.Linear(size, width), nn.ReLU()]
            size = width
        self.decoder = nn.Sequential(*layers, nn.Linear(size, 3 * points), nn.Tanh())

    def rebuilt(self, features: Tensor) -> Tensor:
        """Map (B, C) features to clouds, (B, points, 3)."""
        cloud: Tensor = self.decoder(features).unflatten(1, (-1, 3))
        return cloud
