"""PointNetLK as its paper has it: convolutions of width 1, BatchNorm, six more passes for the Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, Literal

import torch
from torch import Tensor, nn


class PlainPointNetLk(nn.Module):
    """Encoder and loop.

    Args:
        widths: Of the layers.
        normalisation: "batch" or "none".
    """

    def __init__(self, *, widths: Sequence[int], normalisation: Literal["batch", "none"] = "batch") -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for size, width in pairwise([3, *widths]):
            layers.append(nn.Conv1d(size, width, 1))
            layers += [nn.BatchNorm1d(width)] if normalisation == "batch" else []
            layers.append(nn.ReLU())
        self.layers = nn.Sequential(*layers)

    def forward(self, points: Tensor) -> Tensor:
        """Map (B, N, 3) to (B, C)."""
        features: Tensor = self.layers(points.transpose(1, 2)).max(dim=2).values
        return features

    def align(self, source: Tensor, target: Tensor, *, iterations: int = 10, step: float = 1e-2) -> Tensor:
        """Return T_target_source, (B, 4, 4)."""
        template = self(target)
        columns = []
        for twist in step * torch.eye(6):
            T = torch.linalg.matrix_exp(_hat(twist))
            columns.append((self(target @ T[:3, :3].T + T[:3, 3]) - template) / step)
        inverse = torch.linalg.pinv(torch.stack(columns, dim=2))
        motion = torch.eye(4).expand(len(source), 4, 4)
        for _ in range(iterations):
            moved = source @ motion[:, :3, :3].transpose(1, 2) + motion[:, None, :3, 3]
            twists = (inverse @ (template - self(moved))[:, :, None])[:, :, 0]
            motion = torch.stack([torch.linalg.matrix_exp(_hat(twist)) for twist in twists]) @ motion
        return motion


def from_ours(state: Mapping[str, Tensor], configuration: Mapping[str, Any]) -> PlainPointNetLk:
    """Return the plain network with the weights of `PointNetLkNetwork(**configuration).state_dict()`."""
    plain = PlainPointNetLk(**configuration)
    kinds = {"linear": nn.Conv1d, "norms": nn.BatchNorm1d}
    renamed = {}
    for name, tensor in state.items():
        _, kind, layer, what = name.split(".")
        places = [place for place, module in enumerate(plain.layers) if isinstance(module, kinds[kind])]
        unsqueezed = tensor[:, :, None] if (kind, what) == ("linear", "weight") else tensor
        renamed[f"layers.{places[int(layer)]}.{what}"] = unsqueezed
    plain.load_state_dict(renamed)
    return plain


def _hat(twist: Tensor) -> Tensor:
    x, y, z, a, b, c = twist
    zero = torch.zeros(())
    rows = [[zero, -z, y, a], [z, zero, -x, b], [-y, x, zero, c], [zero, zero, zero, zero]]
    return torch.stack([torch.stack(row) for row in rows])
