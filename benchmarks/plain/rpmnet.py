"""RPM-Net written straight from the paper, to measure regbench_baselines.rpmnet against.

Convolutions run on all neighbours; every iteration computes the features of both clouds anew, layer by layer on
(batch, channels, points, neighbours) arrays, and the matches as matrices in log space.
"""

from __future__ import annotations

import torch
from regbench_baselines.rpmnet.local_geometry import LocalGeometry
from torch import Tensor, nn
from torch.nn import functional


class ChannelNorm(nn.LayerNorm):
    """Layer normalisation over the channels of (B, C, N)."""

    def forward(self, values: Tensor) -> Tensor:
        return super().forward(values.transpose(1, 2)).transpose(1, 2)


class PlainRpmNet(nn.Module):
    def __init__(self, width=96, radius=0.3, neighbours=24, normal_neighbours=24):
        super().__init__()
        self.surroundings = {"radius": radius, "neighbours": neighbours, "normal_neighbours": normal_neighbours}
        self.prepool = nn.Sequential(
            nn.Conv2d(10, width, 1), nn.ReLU(), nn.Conv2d(width, width, 1), nn.ReLU(), nn.Conv2d(width, 2 * width, 1)
        )
        self.postpool = nn.Sequential(
            ChannelNorm(2 * width),
            nn.ReLU(),
            nn.Conv1d(2 * width, 2 * width, 1),
            ChannelNorm(2 * width),
            nn.ReLU(),
            nn.Conv1d(2 * width, width, 1),
            ChannelNorm(width),
            nn.ReLU(),
            nn.Conv1d(width, width, 1),
        )
        widths = (4, 64, 64, 64, 128, 1024)
        self.points = nn.Sequential(
            *(part for i in range(5) for part in (nn.Conv1d(widths[i], widths[i + 1], 1), nn.ReLU()))
        )
        self.head = nn.Sequential(
            nn.Linear(1024, 512), nn.ReLU(), nn.Linear(512, 256), nn.ReLU(), nn.Linear(256, 2), nn.Softplus()
        )

    def load_ours(self, state: dict[str, Tensor]) -> None:
        """Take the weights of `RpmNet.state_dict()`."""
        named = {}
        for name, tensor in state.items():
            network, rest = name.split(".", 1)
            if network == "features":
                part, place, kind = rest.split(".")
                name = f"prepool.{2 * int(place)}.{kind}" if part == "before" else f"postpool.{place}.{kind}"
            else:
                part, *place = rest.split(".")
                if part == "widest":
                    name = f"points.8.{place[0]}"
                else:
                    name = f"head.{int(place[0]) - 1}.{place[1]}" if part == "head" else rest
            named[name] = tensor.view(self.get_parameter(name).shape)
        self.load_state_dict(named)

    def features(self, points: Tensor) -> Tensor:
        """Map (B, N, 3) to (B, N, width)."""
        rows = LocalGeometry.of(points, **self.surroundings).rows()
        pooled = self.prepool(rows.permute(0, 3, 1, 2)).amax(dim=3)
        return functional.normalize(self.postpool(pooled).transpose(1, 2), dim=2)

    def forward(self, source: Tensor, target: Tensor, iterations: int = 5) -> Tensor:
        """Return T_target_source, (B, 4, 4)."""
        T = torch.eye(4).to(source).repeat(len(source), 1, 1)
        for _ in range(iterations):
            moved = source @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3]
            both = [functional.pad(cloud, (0, 1), value=which) for cloud, which in ((moved, 0.0), (target, 1.0))]
            beta, alpha = self.head(self.points(torch.cat(both, dim=1).transpose(1, 2)).amax(dim=2)).unbind(dim=1)
            distances = torch.cdist(self.features(moved), self.features(target)).square()
            matches = log_matches(beta[:, None, None] * (alpha[:, None, None] - distances)).exp()
            shares = matches.sum(dim=2, keepdim=True)
            T = kabsch(source, matches @ target / (shares + 1e-8), shares)
        return T


def log_matches(scores: Tensor, iterations: int = 5) -> Tensor:
    """Sinkhorn in log space with a row and a column of slack that are not normalised themselves."""
    padded = functional.pad(scores, (0, 1, 0, 1))
    for _ in range(iterations):
        rows = padded[:, :-1] - padded[:, :-1].logsumexp(dim=2, keepdim=True)
        padded = torch.cat([rows, padded[:, -1:]], dim=1)
        columns = padded[:, :, :-1] - padded[:, :, :-1].logsumexp(dim=1, keepdim=True)
        padded = torch.cat([columns, padded[:, :, -1:]], dim=2)
    return padded[:, :-1, :-1]


def kabsch(source: Tensor, target: Tensor, weights: Tensor) -> Tensor:
    """The weighted least-squares motion, weights (B, N, 1)."""
    weights = weights / weights.sum(dim=1, keepdim=True)
    source_mean, target_mean = ((weights * points).sum(dim=1, keepdim=True) for points in (source, target))
    U, _, Vt = torch.linalg.svd(((target - target_mean) * weights).transpose(1, 2) @ (source - source_mean))
    sign = torch.ones_like(U[:, 0])
    sign[:, 2] = torch.det(U @ Vt)
    R = (U * sign[:, None]) @ Vt
    T = torch.eye(4).to(source).repeat(len(source), 1, 1)
    T[:, :3, :3] = R
    T[:, :3, 3:] = target_mean.transpose(1, 2) - R @ source_mean.transpose(1, 2)
    return T
