import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from regbench.learning.layers.ball_neighbours import _selected, ball_neighbours

# The second is what runs where there is no compiled loop.
BOTH = pytest.mark.parametrize("search", [ball_neighbours, _selected])


@BOTH
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize(("radius", "k"), [(0.3, 8), (0.3, 64), (0.1, 8), (5.0, 10), (1e-9, 3), (0.3, 300)])
def test_neighbours_are_those_of_a_kd_tree(search, dtype, radius, k):
    points = torch.rand(2, 200, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64).to(dtype)
    found = search(points, radius, k)
    assert found.shape == (2, 200, k)
    assert found.dtype == torch.int64
    for cloud, rows in zip(points.double().numpy(), found.numpy(), strict=True):
        distances, indices = cKDTree(cloud).query(cloud, k=min(k, 200), distance_upper_bound=np.nextafter(radius, 9))
        for i, (distance, index, row) in enumerate(zip(distances, indices, rows, strict=True)):
            expected = index[np.isfinite(distance)]
            assert set(row) == set(expected)
            assert (row == i).sum() == 1 + k - len(expected)


@BOTH
def test_a_neighbour_on_the_ball_counts_and_one_beyond_does_not(search):
    points = torch.tensor([[[0.0, 0, 0], [0, 0.5, 0], [0, 0, -0.500001]]])
    assert search(points, 0.5, 3)[0, 0].sort().values.tolist() == [0, 0, 1]


@BOTH
def test_equal_points_are_different_neighbours(search):
    assert search(torch.zeros(1, 4, 3), 0.1, 4).sort(dim=2).values.tolist() == [[[0, 1, 2, 3]] * 4]


def test_points_that_are_not_contiguous_or_have_gradients_are_read_right():
    points = torch.rand(1, 50, 3)
    flipped = points.transpose(1, 2).contiguous().transpose(1, 2).requires_grad_()
    assert torch.equal(ball_neighbours(flipped, 0.4, 5), ball_neighbours(points, 0.4, 5))


@pytest.mark.parametrize(
    ("shape", "radius", "k"), [((4, 3), 1, 2), ((1, 4, 2), 1, 2), ((1, 4, 3), -1, 2), ((1, 4, 3), 1, 0)]
)
def test_bad_arguments_are_refused(shape, radius, k):
    with pytest.raises(ValueError, match="ball_neighbours needs"):
        ball_neighbours(torch.zeros(shape), radius, k)
