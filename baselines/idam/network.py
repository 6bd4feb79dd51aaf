"""IDAM's network: features, hard elimination, and iterations of matching, elimination and a weighted motion."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from regbench.learning.layers.weighted_kabsch import weighted_kabsch
from regbench.learning.pair_network import Alignment, PairNetwork

from .features import Geometry, PointFeatures
from .similarity import Points, SimilarityConvolution

# Clouds of fewer points than this are not thinned: a sixth of them determines no motion.
LEAST_KEPT = 64


class Features(NamedTuple):
    """What both clouds bring to all iterations.

    Attributes:
        source: Points of the source.
        target: Points of the target.
        source_significance: (B, N), the higher the better.
        target_significance: (B, M).
    """

    source: Points
    target: Points
    source_significance: Tensor
    target_significance: Tensor


class IdamNetwork(PairNetwork):
    """Iterative distance-aware similarity matrix convolution (Li et al., ECCV 2020), the GNN variant.

    Args:
        geometry: What the features are made from, see `PointFeatures`.
        width: Channels of a point.
        layers: Graph layers.
        k: Neighbours.
        pair_width: Channels of a pair of points.
        iterations: Iterations, each with weights of its own.
        compared: See `SimilarityConvolution`.
    """

    def __init__(
        self,
        *,
        geometry: Geometry = "xyz",
        width: int = 64,
        layers: int = 5,
        k: int = 12,
        pair_width: int = 32,
        iterations: int = 3,
        compared: bool = False,
    ) -> None:
        super().__init__()
        self.points = PointFeatures(geometry=geometry, width=width, layers=layers, k=k)
        self.significance = nn.Sequential(
            nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width // 2), nn.ReLU(), nn.Linear(width // 2, 1)
        )
        self.similarities = nn.ModuleList(
            SimilarityConvolution(features=width, width=pair_width, compared=compared) for _ in range(iterations)
        )

    def features(self, source: Tensor, target: Tensor) -> Features:
        """Return the features of (B, N, 3) and (B, M, 3) clouds and their significance."""
        of_source, of_target = self.points(source), self.points(target)
        return Features(
            Points(source, of_source),
            Points(target, of_target),
            self.significance(of_source)[:, :, 0],
            self.significance(of_target)[:, :, 0],
        )

    def align(self, source: Tensor, target: Tensor, **options: Any) -> Alignment:
        """Return the motions of a batch.

        Args:
            source: (B, N, 3) float32.
            target: (B, M, 3) float32.
            options: `iterations`, those beyond the trained ones with the last one's weights (default: as trained);
                `source_share` and `target_share`, the shares of the clouds that hard elimination keeps (default: a
                sixth, and all).
        """
        iterations = options.get("iterations", len(self.similarities))
        found = self.features(source, target)
        kept_source = kept(found.source, found.source_significance, options.get("source_share", 1 / 6))
        kept_target = kept(found.target, found.target_significance, options.get("target_share", 1.0))
        T_target_source = torch.eye(4).to(source).repeat(len(source), 1, 1)
        validity = source.new_ones(kept_source.xyz.shape[:2])
        for i in range(iterations):
            similarity: Any = self.similarities[min(i, len(self.similarities) - 1)]
            best, validity = similarity.match(moved(T_target_source, kept_source), kept_target)
            T_target_source = motion(kept_source.xyz, at(kept_target.xyz, best), validity)
        return Alignment(T_target_source, iterations=iterations, confidence=validity.mean(dim=1))


def kept(points: Points, significance: Tensor, share: float) -> Points:
    """Return the most significant points (hard elimination): a share of them, of small clouds more."""
    number = significance.shape[1]
    count = min(number, max(LEAST_KEPT, math.ceil(share * number)))
    if count == number:
        return points
    return chosen(points, significance.topk(count, dim=1, sorted=False).indices)


def chosen(points: Points, indices: Tensor) -> Points:
    """Return the points that (B, K) indices name."""
    return Points(at(points.xyz, indices), at(points.features, indices))


def at(values: Tensor, indices: Tensor) -> Tensor:
    """Return the rows of (B, N, C) values that (B, K) indices name, (B, K, C)."""
    return values.gather(1, indices[:, :, None].expand(-1, -1, values.shape[2]))


def moved(T_target_source: Tensor, source: Points) -> Points:
    """Return source points by a motion so far; their features stay as they are."""
    R, t = T_target_source[:, :3, :3], T_target_source[:, :3, 3]
    return source._replace(xyz=source.xyz @ R.transpose(1, 2) + t[:, None])


def motion(source: Tensor, matches: Tensor, validity: Tensor) -> Tensor:
    """Return the motion of matches, weighted by their validity, but for those under its median."""
    weights = torch.where(validity >= validity.median(dim=1, keepdim=True).values, validity, 0)
    return weighted_kabsch(source, matches, weights)
