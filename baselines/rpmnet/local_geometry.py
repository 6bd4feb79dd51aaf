"""What a point's surroundings are like: offsets of its neighbours, and point pair features, which no motion changes."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from regbench.learning.layers.ball_neighbours import ball_neighbours
from regbench.learning.layers.normals import estimate_normals


@dataclass(frozen=True, eq=False)
class LocalGeometry:
    """The surroundings of the points of a batch of clouds. Found once: a motion turns the offsets, and no more.

    Attributes:
        points: (B, N, 3).
        offsets: (B, N, k, 3), neighbours minus point.
        ppf: (B, N, k, 4), see `point_pair_features`.
    """

    points: Tensor
    offsets: Tensor
    ppf: Tensor

    @staticmethod
    def of(points: Tensor, *, radius: float, neighbours: int, normal_neighbours: int) -> LocalGeometry:
        """Return the surroundings of (B, N, 3) points: the nearest neighbours within a radius."""
        with torch.no_grad():
            normals = estimate_normals(points, normal_neighbours)
            found = ball_neighbours(points, radius, neighbours)
            clouds = torch.arange(len(points), device=points.device)[:, None, None]
            offsets = points[clouds, found] - points[:, :, None]
            ppf = point_pair_features(offsets, normals[:, :, None], normals[clouds, found])
        return LocalGeometry(points, offsets, ppf)

    def rows(self, T: Tensor | None = None) -> Tensor:
        """Return what the feature network sees, (B, N, k, 10): point, offset and point pair features.

        Args:
            T: (B, 4, 4) motions that the clouds are moved by first, or None.
        """
        points, offsets = self.points, self.offsets
        if T is not None:
            R = T[:, :3, :3]
            points = points @ R.transpose(1, 2) + T[:, None, :3, 3]
            offsets = (offsets.flatten(1, 2) @ R.transpose(1, 2)).view_as(offsets)
        return torch.cat([points[:, :, None].expand_as(offsets), offsets, self.ppf], dim=3)


def point_pair_features(offsets: Tensor, normals: Tensor, others: Tensor) -> Tensor:
    """Return (angle(n, d), angle(n', d), angle(n, n'), |d|) of pairs of points (Drost et al. 2010).

    Angles between lines, in [0, pi/2], since the signs of estimated normals are arbitrary. They are arc tangents,
    as in RPM-Net: exact for small angles. With d = 0 angles are 0.

    Args:
        offsets: d, (..., 3).
        normals: n of the first points, broadcast with `offsets`.
        others: n' of the second ones.

    Returns:
        (..., 4) of the same type, angles in radians.
    """
    pairs = ((normals, offsets), (others, offsets), (normals, others))
    angles = [_angle_of_lines(*pair) for pair in pairs]
    return torch.stack([*angles, torch.linalg.vector_norm(offsets, dim=-1)], dim=-1)


def _angle_of_lines(first: Tensor, second: Tensor) -> Tensor:
    sine = torch.linalg.vector_norm(torch.linalg.cross(first, second), dim=-1)
    return torch.atan2(sine, (first * second).sum(dim=-1).abs())
