"""Actions: three Euler angles and a translation, [e, t] in R^6, and the rigid motions that they stand for.

R(e) = Rx(e1) Ry(e2) Rz(e3) on column vectors, angles in radians: the convention of regbench.geometry.se3, in torch.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from regbench.geometry.se3 import euler_deg_from_rotation, rotation_from_euler_deg, se3

ACTION_SIZE = 6


def rotations_of(actions: Tensor) -> Tensor:
    """Return the rotations R(e) of (..., 6) actions, (..., 3, 3)."""
    (cx, cy, cz), (sx, sy, sz) = actions[..., :3].cos().unbind(-1), actions[..., :3].sin().unbind(-1)
    rows = (
        torch.stack([cy * cz, -cy * sz, sy], dim=-1),
        torch.stack([cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy], dim=-1),
        torch.stack([sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy], dim=-1),
    )
    return torch.stack(rows, dim=-2)


def move(clouds: Tensor, actions: Tensor) -> Tensor:
    """Return X' = R(e) X + t for (..., N, 3) clouds and (..., 6) actions."""
    return clouds @ rotations_of(actions).transpose(-1, -2) + actions[..., None, 3:]


def motion_of(action: ArrayLike) -> NDArray[np.float64]:
    """Return the (4, 4) float64 motion of one action, (6,)."""
    values = np.asarray(action, dtype=np.float64)
    return se3(rotation_from_euler_deg(np.degrees(values[:3])), values[3:])


def action_of(T: ArrayLike) -> NDArray[np.float64]:
    """Return the action of one (4, 4) motion, (6,) float64; e2 lies in [-pi/2, pi/2]."""
    matrix = np.asarray(T, dtype=np.float64)
    return np.concatenate([np.radians(euler_deg_from_rotation(matrix[:3, :3])), matrix[:3, 3]])
