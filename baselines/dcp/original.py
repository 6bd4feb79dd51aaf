"""DCP-v1 with its authors' layers, for their weights."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from regbench.learning.layers.neighbours import nearest_neighbours

from .network import WIDTHS, SoftMatchingNetwork


class DcpV1Network(SoftMatchingNetwork):
    """Deep Closest Point without attention (Wang and Solomon, ICCV 2019, DCP-v1).

    Their DGCNN has one graph, in xyz, and layers on its edges one after the other; the maxima over the neighbours after
    each are a point's features. BatchNorm is a part of the layers (`renamed_v1`), so it is not for training.

    Args:
        width: Channels of a point's embedding.
        k: Neighbours, the point itself counted.
    """

    def __init__(self, *, width: int = 512, k: int = 20) -> None:
        super().__init__()
        self.k = k
        self.edges = nn.ModuleList(nn.Linear(*sizes) for sizes in zip((6, *WIDTHS[:-1]), WIDTHS, strict=True))
        self.embedding = nn.Linear(sum(WIDTHS), width)

    def embeddings(self, source: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """Return each cloud's embedding, (B, N, width) and (B, M, width)."""
        return self._dgcnn(source), self._dgcnn(target)

    def _dgcnn(self, points: Tensor) -> Tensor:
        neighbours = nearest_neighbours(points, self.k)
        batch = torch.arange(len(points), device=points.device)[:, None, None]
        near = points[batch, neighbours]
        edges = torch.cat([near, points[:, :, None].expand_as(near)], dim=3)
        found = []
        for layer in self.edges:
            edges = layer(edges).relu_()
            found.append(edges.amax(dim=2))
        embedded: Tensor = self.embedding(torch.cat(found, dim=2)).relu_()
        return embedded
