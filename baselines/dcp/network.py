"""DCP-v2's network: DGCNN, a transformer between the clouds, soft matches."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from regbench.learning.layers.edge_convolution import EdgeConvolution
from regbench.learning.layers.weighted_kabsch import weighted_kabsch
from regbench.learning.pair_network import Alignment, PairNetwork

WIDTHS = (64, 64, 128, 256)
HEADS = 4
SLOPE = 0.2


class SoftMatchingNetwork(PairNetwork):
    """Embeddings of points, matches by their products, and the motion of those: what DCP-v1 and DCP-v2 share."""

    @abstractmethod
    def embeddings(self, source: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """Return the clouds' embeddings, (B, N, width) and (B, M, width)."""

    def align(self, source: Tensor, target: Tensor, **options: Any) -> Alignment:
        """Return the motions of a batch.

        Args:
            source: (B, N, 3) float32.
            target: (B, M, 3) float32.
            options: `iterations`, each beginning where the one before ended (default: 1, as in the paper).
        """
        iterations = options.get("iterations", 1)
        T_target_source = torch.eye(4).to(source).repeat(len(source), 1, 1)
        for _ in range(iterations):
            placed = source @ T_target_source[:, :3, :3].transpose(1, 2) + T_target_source[:, None, :3, 3]
            of_source, of_target = self.embeddings(placed, target)
            # The targets' mean, weighted by the softmax of scaled products.
            matches = functional.scaled_dot_product_attention(of_source, of_target, target)
            T_target_source = weighted_kabsch(source, matches)
        return Alignment(T_target_source, iterations=iterations)


class DcpNetwork(SoftMatchingNetwork):
    """Deep Closest Point with attention (Wang and Solomon, ICCV 2019, DCP-v2).

    Args:
        width: Channels of a point's embedding, a multiple of 4.
        hidden: Channels inside the transformer's feed-forward layers.
        k: Neighbours in DGCNN's graphs, the point itself counted.
    """

    def __init__(self, *, width: int = 512, hidden: int = 1024, k: int = 20) -> None:
        super().__init__()
        self.k = k
        self.edges = nn.ModuleList(
            EdgeConvolution(first, second, slope=SLOPE, normalisation="layer")
            for first, second in zip((3, *WIDTHS[:-1]), WIDTHS, strict=True)
        )
        self.embedding = nn.Linear(sum(WIDTHS), width)
        self.norm = nn.LayerNorm(width)
        kind = {"d_model": width, "nhead": HEADS, "dim_feedforward": hidden, "dropout": 0.0, "batch_first": True}
        self.encoder = nn.TransformerEncoderLayer(norm_first=True, **kind)  # type: ignore[arg-type]  # as documented
        self.encoded = nn.LayerNorm(width)
        self.decoder = nn.TransformerDecoderLayer(norm_first=True, **kind)  # type: ignore[arg-type]
        self.decoded = nn.LayerNorm(width)

    def embeddings(self, source: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """Return the clouds' embeddings, each with regard to the other, (B, N, width) and (B, M, width)."""
        of_source, of_target = self._dgcnn(source), self._dgcnn(target)
        return of_source + self._attention(of_source, of_target), of_target + self._attention(of_target, of_source)

    def _dgcnn(self, points: Tensor) -> Tensor:
        """Return the embedding of each point by its own cloud, (B, N, width)."""
        features, found = points, []
        for layer in self.edges:
            features = layer(features, self.k)
            found.append(features)
        embedded: Tensor = self.norm(self.embedding(torch.cat(found, dim=2)))
        return functional.leaky_relu(embedded, SLOPE)

    def _attention(self, of_cloud: Tensor, of_other: Tensor) -> Tensor:
        """Return what the transformer adds to a cloud's embedding: the other encoded, this one decoded."""
        encoded = self.encoded(self.encoder(of_other))
        decoded: Tensor = self.decoded(self.decoder(of_cloud, encoded))
        return decoded


def log_matches(of_source: Tensor, of_target: Tensor) -> Tensor:
    """Return the logarithms of the soft matches, (B, N, M)."""
    scores = of_source @ of_target.transpose(1, 2) / math.sqrt(of_source.shape[2])
    return scores.log_softmax(dim=2)
