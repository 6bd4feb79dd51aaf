"""Rigid motions from twists, with gradients."""

from __future__ import annotations

import math

import torch
from torch import Tensor

# Row g is the (4, 4) matrix of the g-th unit twist of (wx, wy, wz, vx, vy, vz), flattened.
GENERATORS = torch.zeros(6, 16, dtype=torch.float64)
GENERATORS[[0, 1, 2, 3, 4, 5], [9, 2, 4, 3, 7, 11]] = 1
GENERATORS[[0, 1, 2], [6, 8, 1]] = -1
# Below half a radian the series to t^6 (t: the angle's square) is exact in float64; above, the closed form loses
# less than two digits of a factor that is multiplied with t.
SERIES_BELOW = 0.25
POWERS = torch.arange(7, dtype=torch.float64)
SERIES = torch.tensor([[(-1) ** n / math.factorial(2 * n + k) for k in (2, 3)] for n in range(7)], dtype=torch.float64)


def se3_exp(twists: Tensor) -> Tensor:
    """Return the motions exp(X) of twists, X = [[w]_x, v; 0, 0].

    exp(X) = I + X + (1 - cos a) / a^2 X^2 + (a - sin a) / a^3 X^3 with a = |w| (Murray, Li and Sastry 1994, section
    2.3), its two factors by their series near a = 0: values and gradients are exact there too.

    Args:
        twists: (B, 6) float32 or float64: rotation w first, in radians, then v in the clouds' unit.

    Returns:
        (B, 4, 4) of the same type.
    """
    X = (twists @ GENERATORS.to(twists)).view(-1, 4, 4)
    square = twists[:, :3].square().sum(dim=1, keepdim=True)
    small = square < SERIES_BELOW
    # Each form gets numbers it can take: a gradient of the other one that is not finite would be NaN times zero.
    by_series = torch.where(small, square, 0) ** POWERS.to(twists) @ SERIES.to(twists)
    squared = torch.where(small, 1, square)
    angle = squared.sqrt()
    closed = torch.cat([2 * (angle / 2).sin().square(), 1 - angle.sin() / angle], dim=1) / squared
    second, third = torch.where(small, by_series, closed)[:, :, None, None].unbind(dim=1)
    X2 = X @ X
    return torch.eye(4).to(twists) + X + second * X2 + third * (X2 @ X)
