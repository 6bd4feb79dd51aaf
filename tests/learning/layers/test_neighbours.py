import pytest
import torch
from scipy.spatial import cKDTree

from regbench.learning.layers.nearest_loops import select_smallest
from regbench.learning.layers.neighbours import nearest_neighbours


@pytest.mark.parametrize(("points", "channels", "k"), [(100, 3, 20), (60, 64, 20), (5, 3, 5)])
def test_neighbours_are_those_of_a_kd_tree(points, channels, k):
    features = torch.randn(3, points, channels, generator=torch.Generator().manual_seed(0))
    found = nearest_neighbours(features, k).sort(dim=2).values
    for cloud, indices in zip(features.double().numpy(), found.numpy(), strict=True):
        expected = cKDTree(cloud).query(cloud, k=k)[1]
        assert {tuple(sorted(row)) for row in expected} == {tuple(row) for row in indices}


def test_the_compiled_selection_keeps_the_smallest_also_among_equals():
    rows = torch.randint(0, 9, (200, 70), generator=torch.Generator().manual_seed(0)).float()
    chosen = torch.empty(200, 12, dtype=torch.int64)
    select_smallest(rows.numpy(), chosen.numpy())
    assert all(len(set(indices)) == 12 for indices in chosen.tolist())
    expected = rows.sort(dim=1).values[:, :12]
    assert torch.equal(rows.gather(1, chosen).sort(dim=1).values, expected)


def test_a_far_cloud_has_the_same_neighbours():
    features = torch.randn(1, 200, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    near, far = nearest_neighbours(features, 8), nearest_neighbours(features + 100, 8)
    torch.testing.assert_close(near.sort(dim=2).values, far.sort(dim=2).values)


def test_k_beyond_the_cloud_gives_the_whole_cloud():
    assert nearest_neighbours(torch.randn(1, 4, 3), 20).sort(dim=2).values.tolist() == [[[0, 1, 2, 3]] * 4]


@pytest.mark.parametrize(("shape", "k"), [((4, 3), 2), ((1, 0, 3), 2), ((1, 4, 3), 0)])
def test_bad_shapes_are_refused(shape, k):
    with pytest.raises(ValueError, match="nearest_neighbours needs"):
        nearest_neighbours(torch.zeros(shape), k)
