"""The layers answer the same on a GPU, where they take other ways than the compiled ones."""

import pytest
import torch

from regbench.learning.layers.ball_neighbours import ball_neighbours
from regbench.learning.layers.pointnet import PointNet
from regbench.learning.layers.pointnet_jacobian import pointnet_jacobian
from regbench.learning.layers.se3_exponential import se3_exp
from regbench.learning.layers.sinkhorn import log_sinkhorn
from regbench.learning.layers.weighted_kabsch import weighted_kabsch

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device here")

POINTS = torch.randn(2, 60, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)


def network(points):
    torch.manual_seed(0)
    return PointNet((16, 40)).to(points).eval()


def without_gradients(points):
    with torch.no_grad():
        return network(points)(points)


@pytest.mark.parametrize(
    "layer",
    [
        lambda points: network(points)(points),
        without_gradients,
        lambda points: torch.cat([each.flatten() for each in pointnet_jacobian(network(points).folded(), points)]),
        lambda points: weighted_kabsch(points, points.flip(1), points[:, :, 0].abs()),
        lambda points: log_sinkhorn(points @ points.transpose(1, 2), 7),
        lambda points: se3_exp(points.view(-1, 6)),
        lambda points: ball_neighbours(points, 0.7, 8).sort(dim=2).values,
    ],
)
def test_the_answer_does_not_depend_on_the_device(layer):
    torch.testing.assert_close(layer(POINTS.cuda()).cpu(), layer(POINTS))
