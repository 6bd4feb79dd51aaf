"""IDAM as its paper has it: convolutions on every edge's and every pair's channels, all pairs in memory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import torch
from torch import Tensor, nn
from torch.nn import functional


class PlainGraphLayer(nn.Module):
    """Convolution on edges, maximum over neighbours, LayerNorm (where the paper has BatchNorm), convolution on points.

    Args:
        in_channels: Channels of a point.
        out_channels: Channels of the answer.
    """

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.edge = nn.Conv2d(2 * in_channels, out_channels, 1, bias=False)
        self.norm = nn.LayerNorm(out_channels)
        self.point = nn.Conv1d(out_channels, out_channels, 1)

    def forward(self, features: Tensor, neighbours: Tensor) -> Tensor:
        """Map (B, C, N) by (B, N, k) neighbours."""
        centre = features[:, :, :, None].expand(-1, -1, -1, neighbours.shape[2])
        highest = self.edge(torch.cat([gathered(features, neighbours) - centre, centre], dim=1)).max(dim=3).values
        activated = functional.leaky_relu(self.norm(highest.transpose(1, 2)).transpose(1, 2), 0.2)
        answer: Tensor = functional.leaky_relu(self.point(activated), 0.2)
        return answer


class PlainSimilarity(nn.Module):
    """The similarity matrix convolution on (B, 2 features + 4, N, M) pairs.

    Args:
        features: Channels of a point.
        width: Channels of a pair.
        compared: Whether the mean squared difference of the features is one more channel (ours).
    """

    def __init__(self, features: int, width: int, compared: bool) -> None:
        super().__init__()
        self.compared = compared
        self.pair = nn.Conv2d(2 * features + (5 if compared else 4), width, 1)
        self.hidden = nn.Conv2d(width, width, 1)
        self.score = nn.Conv2d(width, 1, 1)
        self.validity = nn.Sequential(nn.Conv1d(width, width, 1), nn.ReLU(), nn.Conv1d(width, 1, 1))

    def forward(self, source: Tensor, of_source: Tensor, target: Tensor, of_target: Tensor) -> tuple[Tensor, Tensor]:
        """Return the similarity matrix (B, N, M) and the validity (B, N) of (B, 3, .) points and their features."""
        N, M = source.shape[2], target.shape[2]
        offsets = source[:, :, :, None] - target[:, :, None]
        distances = offsets.norm(dim=1, keepdim=True)
        of_source = of_source[:, :, :, None].expand(-1, -1, -1, M)
        of_target = of_target[:, :, None].expand(-1, -1, N, -1)
        channels = [of_source, of_target, distances, offsets / distances.clamp_min(1e-30)]
        if self.compared:
            channels.append((of_source - of_target).square().mean(dim=1, keepdim=True))
        pairs = torch.cat(channels, dim=1)
        pairs = functional.relu(self.hidden(functional.relu(self.pair(pairs))))
        similarity = self.score(pairs)[:, 0].softmax(dim=2)
        return similarity, self.validity(pairs.max(dim=3).values)[:, 0].sigmoid()


class PlainIdam(nn.Module):
    """The network.

    Args:
        geometry: "xyz", or "both" and "invariant", ours.
        width: Channels of a point.
        layers: Graph layers.
        k: Neighbours.
        pair_width: Channels of a pair.
        iterations: Iterations.
        compared: See `PlainSimilarity`.
    """

    def __init__(
        self,
        *,
        geometry: Literal["xyz", "invariant", "both"] = "xyz",
        width: int = 64,
        layers: int = 5,
        k: int = 12,
        pair_width: int = 32,
        iterations: int = 3,
        compared: bool = False,
    ) -> None:
        super().__init__()
        self.geometry, self.k = geometry, k
        first = {"xyz": 3, "invariant": 2 * k, "both": 3 + 2 * k}[geometry]
        self.layers = nn.ModuleList(PlainGraphLayer(width if i else first, width) for i in range(layers))
        self.significance = nn.Sequential(
            nn.Conv1d(width, width, 1),
            nn.ReLU(),
            nn.Conv1d(width, width // 2, 1),
            nn.ReLU(),
            nn.Conv1d(width // 2, 1, 1),
        )
        self.similarities = nn.ModuleList(PlainSimilarity(width, pair_width, compared) for _ in range(iterations))

    def align(
        self, source: Tensor, target: Tensor, *, source_share: float = 1 / 6, target_share: float = 1.0
    ) -> Tensor:
        """Return T_target_source, (B, 4, 4), of (B, N, 3) and (B, M, 3)."""
        p, of_source = self.kept(source, source_share)
        q, of_target = self.kept(target, target_share)
        motion = torch.eye(4).repeat(len(source), 1, 1)
        for convolution in self.similarities:
            moved = motion[:, :3, :3] @ p + motion[:, :3, 3:]
            similarity, validity = convolution(moved, of_source, q, of_target)
            matches = gathered(q, similarity.argmax(dim=2)[:, :, None])[:, :, :, 0]
            weights = validity * (validity >= validity.median(dim=1, keepdim=True).values)
            motion = weighted_motion(p, matches, weights / weights.sum(dim=1, keepdim=True))
        return motion

    def kept(self, cloud: Tensor, share: float) -> tuple[Tensor, Tensor]:
        """Return the most significant points of a cloud, (B, 3, K), and their features, (B, width, K)."""
        points = cloud.transpose(1, 2)
        neighbours = torch.cdist(cloud, cloud).topk(min(self.k, cloud.shape[1]), dim=2, largest=False).indices
        features = points
        if self.geometry != "xyz":
            features = invariants(points, neighbours)
        if self.geometry == "both":
            features = torch.cat([points, features], dim=1)
        for layer in self.layers:
            features = layer(features, neighbours)
        count = min(cloud.shape[1], max(64, math.ceil(share * cloud.shape[1])))
        best = self.significance(features)[:, 0].topk(count, dim=1).indices[:, :, None]
        return gathered(points, best)[:, :, :, 0], gathered(features, best)[:, :, :, 0]


def invariants(points: Tensor, neighbours: Tensor) -> Tensor:
    """Return radius, neighbours' distances and their radii's differences, (B, 2 k, N); clouds have k points or more."""
    near = gathered(points, neighbours)
    radii = points.norm(dim=1)
    distances = (near - points[:, :, :, None]).norm(dim=1).sort(dim=2).values
    rises = (near.norm(dim=1) - radii[:, :, None]).sort(dim=2).values
    unit = distances[:, :, -1:].mean(dim=1, keepdim=True)
    return torch.cat([radii[:, :, None], distances[:, :, 1:] / unit, rises / unit], dim=2).transpose(1, 2)


def gathered(values: Tensor, indices: Tensor) -> Tensor:
    """Return (B, C, N, k) of (B, C, M) values by (B, N, k) indices."""
    return torch.stack([each[:, index] for each, index in zip(values, indices, strict=True)])


def weighted_motion(source: Tensor, target: Tensor, weights: Tensor) -> Tensor:
    """Return the motion of (B, 3, N) matches by the weighted SVD; weights sum to one."""
    source_mean, target_mean = ((cloud * weights[:, None]).sum(dim=2, keepdim=True) for cloud in (source, target))
    U, _, Vt = torch.linalg.svd((target - target_mean) * weights[:, None] @ (source - source_mean).transpose(1, 2))
    sign = torch.ones(len(source), 3)
    sign[:, 2] = torch.det(U @ Vt)
    R = U @ torch.diag_embed(sign) @ Vt
    motion = torch.eye(4).repeat(len(source), 1, 1)
    motion[:, :3, :3], motion[:, :3, 3:] = R, target_mean - R @ source_mean
    return motion


def from_ours(state: Mapping[str, Tensor], configuration: Mapping[str, Any]) -> PlainIdam:
    """Return the plain network with the weights of `IdamNetwork(**configuration).state_dict()`."""
    plain = PlainIdam(**configuration)
    shapes, renamed = plain.state_dict(), {name.removeprefix("points."): tensor for name, tensor in state.items()}
    plain.load_state_dict({name: tensor.reshape(shapes[name].shape) for name, tensor in renamed.items()})
    return plain
