"""The closed form against LAPACK, and where no direction stands out."""

import pytest
import torch

from regbench.learning.layers.least_direction import least_direction


def spreads(values, count=2000):
    generator = torch.Generator().manual_seed(0)
    frames = torch.linalg.qr(torch.randn(count, 3, 3, generator=generator, dtype=torch.float64))[0]
    spread = frames @ torch.diag(torch.tensor(values, dtype=torch.float64)) @ frames.mT
    return (spread + spread.mT) / 2


@pytest.mark.parametrize("values", [(1.0, 2.0, 3.0), (0.0, 1.0, 1.0), (1e-9, 1e-3, 1.0), (0.9, 1.0, 1.0)])
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_it_is_lapacks_where_the_least_stands_apart(values, scale):
    spread = spreads(values) * scale
    expected = torch.linalg.eigh(spread).eigenvectors[..., 0]
    found = least_direction(spread)
    torch.testing.assert_close(torch.linalg.cross(found, expected), torch.zeros_like(found), atol=1e-6, rtol=0)
    torch.testing.assert_close(found.norm(dim=-1), torch.ones(len(found), dtype=torch.float64))


@pytest.mark.parametrize("axis", [0, 1, 2, None])
def test_on_a_line_it_is_a_perpendicular(axis):
    if axis is None:
        spread = spreads((0.0, 0.0, 5.0))
    else:
        spread = torch.zeros(1, 3, 3, dtype=torch.float64)
        spread[0, axis, axis] = 5.0
    found = least_direction(spread)
    torch.testing.assert_close(found.norm(dim=-1), torch.ones(len(found), dtype=torch.float64))
    along = (found[:, None] @ spread @ found[:, :, None]).flatten()
    torch.testing.assert_close(along, torch.zeros_like(along), atol=1e-6, rtol=0)


@pytest.mark.parametrize("spread", [torch.zeros(2, 3, 3), 4 * torch.eye(3)[None]])
def test_where_all_are_alike_it_is_some_unit_vector(spread):
    found = least_direction(spread.double())
    torch.testing.assert_close(found.norm(dim=-1), torch.ones(len(found), dtype=torch.float64))
