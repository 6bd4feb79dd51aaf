"""Encoders: a cloud to its latent state z (the paper's section 3.1)."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from regbench.learning.layers.edge_convolution import EdgeConvolution, Normalisation
from regbench.learning.layers.linear_max import linear_max
from regbench.learning.layers.neighbour_max import neighbour_max
from regbench.learning.layers.neighbours import nearest_neighbours

LATENT_SIZE = 512
POINTS = 784  # of a cloud in the paper
LEAST_NEIGHBOURS, MOST_NEIGHBOURS = 8, 40


class DgcnnEncoder(nn.Module):
    """Dynamic DGCNN (Wang et al. 2019): four edge convolutions, their answers side by side, one layer, max over points.

    The paper names DGCNN and the latent's 512; widths and k are DGCNN's own. Without BatchNorm: X, X' and Y have
    different statistics, and predictions were useless in evaluation mode with it.

    Args:
        k: Neighbours in the graph, which is rebuilt in the features of every layer, for clouds of 784 points. Larger
            and smaller clouds get as many more or fewer, from 8 to 40: so a neighbourhood is the same part of the
            surface, and features depend less on the density.
        normalisation: "none", or "layer" for LayerNorm over the channels of a point.
    """

    def __init__(self, *, k: int = 20, normalisation: Normalisation = "none") -> None:
        super().__init__()
        self.k = k
        widths = (3, 64, 64, 128, 256)
        self.convolutions = nn.ModuleList(
            EdgeConvolution(before, after, normalisation=normalisation) for before, after in pairwise(widths)
        )
        self.last = nn.Linear(sum(widths[1:]), LATENT_SIZE)

    def forward(self, clouds: Tensor) -> Tensor:
        """Map (B, N, 3) clouds to (B, 512) latent states, whatever the order of the points."""
        k = min(max(round(self.k * clouds.shape[1] / POINTS), LEAST_NEIGHBOURS), MOST_NEIGHBOURS)
        features, answers = clouds, []
        for convolution in self.convolutions:
            features = convolution(features, k)
            answers.append(features)
        # LeakyReLU is monotone: after the maximum it is the same, on N times fewer values.
        pooled = linear_max(torch.cat(answers, dim=2), self.last.weight, self.last.bias)
        return functional.leaky_relu(pooled, 0.2)


class FoldingEncoder(nn.Module):
    """FoldingNet's encoder (Yang et al. 2018): a PointNet on points and local covariances with two graph layers.

    A graph layer takes the maximum over the neighbours in space, then a linear map.

    Args:
        k: Neighbours in the graph, built once in space.
    """

    def __init__(self, *, k: int = 16) -> None:
        super().__init__()
        self.k = k
        self.points = nn.Sequential(
            nn.Linear(12, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU()
        )
        self.graph = nn.ModuleList([nn.Linear(64, 128), nn.Linear(128, 1024)])
        self.last = nn.Sequential(nn.Linear(1024, LATENT_SIZE), nn.ReLU(), nn.Linear(LATENT_SIZE, LATENT_SIZE))

    def forward(self, clouds: Tensor) -> Tensor:
        """Map (B, N, 3) clouds to (B, 512) latent states, whatever the order of the points."""
        neighbours = nearest_neighbours(clouds, self.k)
        features = self.points(torch.cat([clouds, local_covariances(clouds, neighbours).flatten(2)], dim=2))
        for layer in self.graph:
            features = functional.relu(layer(neighbour_max(features, neighbours)))
        latent: Tensor = self.last(features.amax(dim=1))
        return latent


def local_covariances(clouds: Tensor, neighbours: Tensor) -> Tensor:
    """Return the covariance of every point's neighbours, (B, N, 3, 3), for (B, N, k) indices."""
    batch = torch.arange(len(clouds), device=clouds.device)[:, None, None]
    near = clouds[batch, neighbours]  # (B, N, k, 3)
    near = near - near.mean(dim=2, keepdim=True)
    return near.transpose(2, 3) @ near / neighbours.shape[2]
