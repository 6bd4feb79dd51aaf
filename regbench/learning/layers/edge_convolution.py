"""DGCNN's edge convolution, factorised: two products on points instead of one on k times more edges."""

from __future__ import annotations

from typing import Literal

from torch import Tensor, nn
from torch.nn import functional

from regbench.learning.layers.neighbour_max import neighbour_max
from regbench.learning.layers.neighbours import nearest_neighbours

Normalisation = Literal["none", "layer"]


class EdgeConvolution(nn.Module):
    """max over j in kNN(i) of LeakyReLU(W [x_j - x_i, x_i] + b), the graph built in the space of the input.

    DGCNN (Wang et al. 2019, Eq. 7 and 8) without BatchNorm: the clouds X, X' and Y have different statistics. With
    W = [A, B] the edge's value is A x_j + (B - A) x_i + b. The second part is the same for all neighbours and
    LeakyReLU is monotone, so the maximum is taken over A x_j alone: exact, not an approximation.

    With `normalisation="layer"`, LayerNorm over the channels follows the maximum and comes before LeakyReLU.

    Args:
        in_channels: Channels of a point.
        out_channels: Channels of the answer.
        slope: LeakyReLU's slope below zero.
        normalisation: "none" or "layer".
    """

    def __init__(
        self,
        in_channels: int,
        out_channels: int,
        *,
        slope: float = 0.2,
        normalisation: Normalisation = "none",
    ) -> None:
        super().__init__()
        self.slope = slope
        self.edge = nn.Linear(2 * in_channels, out_channels)
        self.norm = nn.LayerNorm(out_channels) if normalisation == "layer" else nn.Identity()
        # Keeps the variance of the activations through layers that no normalisation holds (He et al. 2015, Eq. 15).
        nn.init.kaiming_normal_(self.edge.weight, a=slope)
        nn.init.zeros_(self.edge.bias)

    def forward(self, features: Tensor, k: int) -> Tensor:
        """Map (B, N, in_channels) to (B, N, out_channels) by the k nearest points of each, itself counted."""
        neighbours = nearest_neighbours(features, k)
        of_neighbour, of_centre = self.edge.weight.chunk(2, dim=1)
        highest = neighbour_max(functional.linear(features, of_neighbour), neighbours)
        centre = functional.linear(features, of_centre - of_neighbour, self.edge.bias)
        activated: Tensor = functional.leaky_relu(self.norm(highest + centre), self.slope)
        return activated
