"""Normals are those of the surface, and move with the cloud."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from regbench.learning.layers.normals import estimate_normals
from regbench.testing.clouds import body


def cosines(first, second):
    return (first * second).sum(dim=2).abs()


def test_on_a_sphere_they_are_radial():
    directions = torch.nn.functional.normalize(
        torch.randn(2, 2000, 3, generator=torch.Generator().manual_seed(0)), dim=2
    )
    normals = estimate_normals(directions, 12)
    assert cosines(normals, directions).min() > 0.97
    torch.testing.assert_close(normals.norm(dim=2), torch.ones(2, 2000))


def test_they_turn_with_the_cloud():
    cloud = body(300)
    R = Rotation.from_rotvec([0.4, -1.0, 0.7]).as_matrix()
    first, second = (torch.from_numpy(points)[None] for points in (cloud, cloud @ R.T + [1.0, 2.0, 3.0]))
    turned = estimate_normals(first, 10) @ torch.from_numpy(R.T)
    np.testing.assert_allclose(cosines(turned, estimate_normals(second, 10)), 1, atol=1e-9)


@pytest.mark.parametrize("cloud", [torch.zeros(1, 5, 3), torch.arange(4.0)[None, :, None].expand(1, 4, 3)])
def test_degenerate_clouds_have_some_unit_normal(cloud):
    torch.testing.assert_close(estimate_normals(cloud, 16).norm(dim=2), torch.ones(cloud.shape[:2]))


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError):
        estimate_normals(torch.zeros(5, 3), 4)
