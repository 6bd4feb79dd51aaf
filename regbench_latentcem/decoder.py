"""Decoders: a latent state z back to a cloud. Used in training only."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from .encoder import LATENT_SIZE, POINTS

GRID = 28  # squared: POINTS


class FoldingDecoder(nn.Module):
    """FoldingNet's decoder (Yang et al. 2018): two 3-layer networks fold a plane grid into the cloud.

    28 x 28 = 784 grid points in [-0.3, 0.3]^2; the second network folds the points that the first one made.
    """

    grid: Tensor

    def __init__(self) -> None:
        super().__init__()
        line = torch.linspace(-0.3, 0.3, GRID)
        self.register_buffer("grid", torch.cartesian_prod(line, line), persistent=False)
        self.first = Fold(2)
        self.second = Fold(3)

    def forward(self, latents: Tensor) -> Tensor:
        """Map (B, 512) latent states to (B, 784, 3) clouds."""
        folded: Tensor = self.second(latents, self.first(latents, self.grid))
        return folded


class Fold(nn.Module):
    """A 3-layer network on [z, p] for every point p: 512 + size -> 512 -> 512 -> 3."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.of_latent = nn.Linear(LATENT_SIZE, 512)
        self.of_point = nn.Linear(size, 512, bias=False)
        self.rest = nn.Sequential(nn.ReLU(), nn.Linear(512, 512), nn.ReLU(), nn.Linear(512, 3))

    def forward(self, latents: Tensor, points: Tensor) -> Tensor:
        """Map (B, 512) latent states and (..., P, size) points to (B, P, 3)."""
        # [z, p] is not made: its product with the layer is a sum of two, and that of z is the same for every point.
        folded: Tensor = self.rest(self.of_latent(latents)[:, None, :] + self.of_point(points))
        return folded


class MlpDecoder(nn.Module):
    """A 3-layer network to 784 points, the alternative in the paper's Table 2. Widths are not stated: 1024."""

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Linear(LATENT_SIZE, 1024)
        self.second = nn.Linear(1024, 1024)
        self.third = nn.Linear(1024, 3 * POINTS)

    def forward(self, latents: Tensor) -> Tensor:
        """Map (B, 512) latent states to (B, 784, 3) clouds."""
        hidden = functional.relu(self.second(functional.relu(self.first(latents))))
        coordinates: Tensor = self.third(hidden)
        return coordinates.view(-1, POINTS, 3)
