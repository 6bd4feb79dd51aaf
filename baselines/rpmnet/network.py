"""RPM-Net's networks: features of points, annealing parameters of a pair of clouds, and the iterations around them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from regbench.learning.layers.linear_max import linear_max
from regbench.learning.layers.weighted_kabsch import weighted_kabsch
from regbench.learning.pair_network import Alignment, PairNetwork

from .local_geometry import LocalGeometry
from .perceptron_max import perceptron_max
from .soft_matches import soft_matches


@dataclass(frozen=True, eq=False)
class Step:
    """One iteration.

    Attributes:
        T_target_source: (B, 4, 4), the motion of the whole source so far.
        source_shares: (B, N), how much of each source point has a partner, in [0, 1].
        target_shares: (B, M), likewise of each target point.
    """

    T_target_source: Tensor
    source_shares: Tensor
    target_shares: Tensor


class FeatureNetwork(nn.Module):
    """Features of points: three layers on each neighbour, their maximum, three layers, unit length.

    The paper's layers, 96-96-192 before the maximum and 192-96-96 after it. Ours has no group normalisation over all
    points of a cloud, with which a point's feature depends on where the cloud is cut: none before the maximum, so that
    the layers there work a few points at a time, and layer normalisation of each point after it. The two were not
    compared by training.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        layers = [nn.Linear(10, width), nn.Linear(width, width), nn.Linear(width, 2 * width)]
        self.before = nn.ModuleList(layers)
        self.after = nn.Sequential(
            nn.LayerNorm(2 * width),
            nn.ReLU(),
            nn.Linear(2 * width, 2 * width),
            nn.LayerNorm(2 * width),
            nn.ReLU(),
            nn.Linear(2 * width, width),
            nn.LayerNorm(width),
            nn.ReLU(),
            nn.Linear(width, width),
        )
        for layer in layers:
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            nn.init.zeros_(layer.bias)

    def forward(self, rows: Tensor) -> Tensor:
        """Map (B, N, k, 10) surroundings to (B, N, width) features."""
        layers = cast(list[nn.Linear], list(self.before))
        pooled = perceptron_max(rows, [layer.weight for layer in layers], [layer.bias for layer in layers])
        return functional.normalize(self.after(pooled), dim=2)


class ParameterNetwork(nn.Module):
    """Annealing parameters of a pair of clouds: a PointNet that sees which cloud a point is of."""

    def __init__(self) -> None:
        super().__init__()
        widths = (4, 64, 64, 64, 128)
        self.points = nn.Sequential(*(part for a, b in pairwise(widths) for part in (nn.Linear(a, b), nn.ReLU())))
        self.widest = nn.Linear(128, 1024)
        last = nn.Linear(256, 2)
        self.head = nn.Sequential(nn.ReLU(), nn.Linear(1024, 512), nn.ReLU(), nn.Linear(512, 256), nn.ReLU(), last)
        for layer in (*self.points, *self.head):
            if isinstance(layer, nn.Linear):
                nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
                nn.init.zeros_(layer.bias)
        # Matches that are neither all alike nor all of one point: features of unit length differ by 4 at most.
        nn.init.normal_(last.weight, std=0.01)
        last.bias.data = torch.tensor([8.0, 0.0])

    def describe(self, cloud: Tensor, which: float) -> Tensor:
        """Return the maximum over a cloud's points, (B, 1024); `which`: 0 for the source, 1 for the target."""
        return linear_max(self.points(functional.pad(cloud, (0, 1), value=which)), self.widest.weight, self.widest.bias)

    def forward(self, source: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """Return alpha and beta, each (B, 1) and positive, from the two clouds' descriptions."""
        beta, alpha = functional.softplus(self.head(torch.maximum(source, target))).chunk(2, dim=1)
        return alpha, beta


class RpmNet(PairNetwork):
    """RPM-Net.

    Args:
        width: Channels of a feature.
        radius: Of a point's surroundings, in extents of the target.
        neighbours: Points of them, itself counted: the nearest.
        normal_neighbours: Points that a normal is estimated from.
    """

    def __init__(
        self, *, width: int = 96, radius: float = 0.3, neighbours: int = 24, normal_neighbours: int = 24
    ) -> None:
        super().__init__()
        self.radius = radius
        self.neighbours = neighbours
        self.normal_neighbours = normal_neighbours
        self.features = FeatureNetwork(width)
        self.annealing = ParameterNetwork()

    def align(self, source: Tensor, target: Tensor, **options: Any) -> Alignment:
        """Return the motions after `iterations` (default 5); the confidence is the share of source points matched."""
        steps = self.steps(source, target, options.get("iterations", 5))
        return Alignment(steps[-1].T_target_source, len(steps), steps[-1].source_shares.mean(dim=1))

    def steps(self, source: Tensor, target: Tensor, iterations: int) -> list[Step]:
        """Return all iterations; a gradient passes through each alone, as in the paper's code.

        Args:
            source: (B, N, 3) float32.
            target: (B, M, 3) float32.
            iterations: At least 1.
        """
        source_geometry, target_geometry = (self._geometry(cloud) for cloud in (source, target))
        target_features = self.features(target_geometry.rows())
        target_description = self.annealing.describe(target, 1.0)
        T = torch.eye(4).to(source).repeat(len(source), 1, 1)
        steps: list[Step] = []
        for _ in range(iterations):
            moved = source @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3]
            alpha, beta = self.annealing(self.annealing.describe(moved, 0.0), target_description)
            features = self.features(source_geometry.rows(T))
            # Both have unit length, so beta (alpha - |f - g|^2) of the paper is 2 beta <f, g> + beta (alpha - 2).
            sums, source_shares, target_shares = soft_matches(
                2 * beta[:, :, None] * features, target_features, (beta * (alpha - 2))[:, 0], target
            )
            partners = sums / (source_shares[:, :, None] + 1e-8)
            steps.append(Step(weighted_kabsch(source, partners, source_shares), source_shares, target_shares))
            T = steps[-1].T_target_source.detach()
        return steps

    def _geometry(self, cloud: Tensor) -> LocalGeometry:
        return LocalGeometry.of(
            cloud, radius=self.radius, neighbours=self.neighbours, normal_neighbours=self.normal_neighbours
        )
