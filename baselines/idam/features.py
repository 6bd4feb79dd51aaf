"""IDAM's features of points: a graph network on the nearest neighbours in xyz."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional

from regbench.learning.layers.neighbour_max import neighbour_max
from regbench.learning.layers.neighbours import nearest_neighbours

Geometry = Literal["xyz", "invariant", "both"]

SLOPE = 0.2


class GraphLayer(nn.Module):
    """max over j in kNN(i) of W [x_j - x_i, x_i], LayerNorm, LeakyReLU, a layer on points.

    With W = [A, B] the edge's value is A x_j + (B - A) x_i, of which the second part is the same for all
    neighbours: the maximum is taken over A x_j alone, exactly. LayerNorm stands where the original has BatchNorm: it
    comes after the maximum and needs no statistics of clouds that differ.

    Args:
        in_channels: Channels of a point.
        out_channels: Channels of the answer.
    """

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.edge = nn.Linear(2 * in_channels, out_channels, bias=False)
        self.norm = nn.LayerNorm(out_channels)
        self.point = nn.Linear(out_channels, out_channels)

    def forward(self, features: Tensor, neighbours: Tensor) -> Tensor:
        """Map (B, N, in_channels) to (B, N, out_channels) on the graph of (B, N, k) int64 neighbours."""
        of_neighbour, of_centre = self.edge.weight.chunk(2, dim=1)
        highest = neighbour_max(functional.linear(features, of_neighbour), neighbours)
        centre = functional.linear(features, of_centre - of_neighbour)
        activated = functional.leaky_relu_(self.norm(highest + centre), SLOPE)
        return functional.leaky_relu_(self.point(activated), SLOPE)


class PointFeatures(nn.Module):
    """Five graph layers of 64 channels on the 12 nearest neighbours in xyz (the paper's GNN variant).

    Args:
        geometry: What a point brings: "xyz", its place, as in the paper; "invariant" (ours), numbers that no rotation
            changes, see `invariants`; "both".
        width: Channels.
        layers: Number of layers.
        k: Neighbours, the point itself counted.
    """

    def __init__(self, *, geometry: Geometry, width: int, layers: int, k: int) -> None:
        super().__init__()
        self.geometry, self.k = geometry, k
        first = {"xyz": 3, "invariant": 2 * k, "both": 3 + 2 * k}[geometry]
        self.layers = nn.ModuleList(GraphLayer(first if i == 0 else width, width) for i in range(layers))

    def forward(self, points: Tensor) -> Tensor:
        """Map (B, N, 3) points to (B, N, width) features."""
        neighbours = nearest_neighbours(points, self.k)
        features = points if self.geometry == "xyz" else invariants(points, neighbours, self.k)
        if self.geometry == "both":
            features = torch.cat([points, features], dim=2)
        for layer in self.layers:
            features = layer(features, neighbours)
        return features


def invariants(points: Tensor, neighbours: Tensor, k: int) -> Tensor:
    """Return what a rotation about the origin leaves: a point's radius, and those and the distances of its neighbours.

    Args:
        points: (B, N, 3), about their centroid.
        neighbours: (B, N, min(k, N)) int64, each point among its own.
        k: Neighbours of which the answer tells; of smaller clouds the farthest stands for those that are missing.

    Returns:
        (B, N, 2 k): the radius |x_i| in the points' unit; k - 1 distances |x_j - x_i| and k differences of radii
        |x_j| - |x_i|, both ascending, in units of the cloud's mean distance to the farthest neighbour.
    """
    batch = torch.arange(len(points), device=points.device)[:, None, None]
    radii = torch.linalg.vector_norm(points, dim=2)
    distances = torch.linalg.vector_norm(points[batch, neighbours] - points[:, :, None], dim=3).sort(dim=2).values
    rises = (radii[batch, neighbours] - radii[:, :, None]).sort(dim=2).values
    unit = distances[:, :, -1].mean(dim=1)[:, None, None].clamp_min(torch.finfo(points.dtype).tiny)
    near = torch.cat([distances, distances[:, :, -1:].expand(-1, -1, k - distances.shape[2])], dim=2)[:, :, 1:]
    high = torch.cat([rises, rises[:, :, -1:].expand(-1, -1, k - rises.shape[2])], dim=2)
    return torch.cat([radii[:, :, None], near / unit, high / unit], dim=2)
