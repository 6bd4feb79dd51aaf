"""The evaluation network of the equivariant model: it reads what no common motion of the two states changes."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from .actions import rotations_of
from .equivariant import VectorState
from .planner import Reward


class PairEvaluation(nn.Module):
    """d(z', z_Y): three layers on invariants of the pair, the predicted Chamfer distance.

    The invariants, for C channels, with the offset u between the centroids: z'_c . z_Y,c (C), u . z_Y,c (C), |z'_c|
    (C), |z_Y,c| (C) and |u|^2.

    Args:
        channels: C of the encoder.
        width: Of the two hidden layers.
    """

    def __init__(self, *, channels: int = 1024, width: int = 256) -> None:
        super().__init__()
        self.of_products = nn.Linear(channels, width)
        self.of_offset = nn.Linear(channels, width, bias=False)
        self.of_sizes = nn.Linear(2 * channels, width, bias=False)
        self.of_distance = nn.Linear(1, width, bias=False)
        self.second = nn.Linear(width, width)
        self.third = nn.Linear(width, 1)

    def forward(self, moved: VectorState, target: VectorState) -> Tensor:
        """Map states of the moved source and of the target, of equal leading dimensions, to (...) distances."""
        offset = moved.centroid - target.centroid
        hidden = (
            self.of_products((moved.vectors * target.vectors).sum(dim=-1))
            + self.of_offset((target.vectors @ offset[..., None]).squeeze(-1))
            + self.of_sizes(torch.cat([_lengths(moved), _lengths(target)], dim=-1))
            + self.of_distance(offset.square().sum(dim=-1, keepdim=True))
        )
        return self._rest(hidden)

    def _rest(self, hidden: Tensor) -> Tensor:
        distance: Tensor = self.third(functional.relu(self.second(functional.relu(hidden))))
        return distance.squeeze(-1)

    def reward(self, source: VectorState, target: VectorState) -> Reward:
        """Return r(a) = -d(f(z_X, a), z_Y) (Eq. 2) as a function of actions, for P pairs.

        The first layer is linear in the products, and R z_X . z_Y = <R, z_Y z_X^T> is linear in R: its share of the
        layer is a (width, 9) matrix, made here once. Likewise for the offset, and lengths do not change with R.
        """
        with torch.no_grad():
            outer = (target.vectors[:, :, :, None] * source.vectors[:, :, None, :]).flatten(2)  # (P, C, 9)
            of_rotation = self.of_products.weight @ outer  # (P, width, 9)
            of_offset = self.of_offset.weight @ target.vectors  # (P, width, 3)
            sizes = self.of_sizes(torch.cat([_lengths(source), _lengths(target)], dim=1))
            constant = (sizes + self.of_products.bias)[:, None]

        @torch.no_grad()
        def reward(actions: Tensor) -> Tensor:
            rotations = rotations_of(actions)
            moved = (rotations @ source.centroid[:, None, :, None]).squeeze(-1) + actions[..., 3:]
            offset = moved - target.centroid[:, None]
            hidden = constant + rotations.flatten(2) @ of_rotation.transpose(1, 2) + offset @ of_offset.transpose(1, 2)
            hidden = hidden + self.of_distance(offset.square().sum(dim=2, keepdim=True))
            return -self._rest(hidden)

        return reward


def _lengths(state: VectorState) -> Tensor:
    lengths: Tensor = torch.linalg.vector_norm(state.vectors, dim=-1)
    return lengths
