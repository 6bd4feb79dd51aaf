import pytest
import torch
from scipy.spatial import cKDTree

from regbench.learning.layers.chamfer import chamfer_distance


def by_kd_tree(first, second):
    return cKDTree(second).query(first)[0].mean() + cKDTree(first).query(second)[0].mean()


def clouds(dtype=torch.float64):
    generator = torch.Generator().manual_seed(0)
    return torch.randn(3, 80, 3, generator=generator).to(dtype), torch.randn(3, 50, 3, generator=generator).to(dtype)


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-6), (torch.float64, 1e-14)])
def test_it_is_scipys(dtype, tolerance):
    first, second = clouds(dtype)
    expected = [by_kd_tree(x.numpy(), y.numpy()) for x, y in zip(first.double(), second.double(), strict=True)]
    answer = chamfer_distance(first, second).double()
    torch.testing.assert_close(answer, torch.tensor(expected, dtype=torch.float64), rtol=0, atol=tolerance)


def test_a_permuted_copy_is_at_distance_zero_in_float32():
    first, _ = clouds(torch.float32)
    assert chamfer_distance(first, first.flip(1)).tolist() == [0, 0, 0]


def test_its_gradients_are_those_of_finite_differences():
    first, second = (cloud[:, :10].clone().requires_grad_() for cloud in clouds())
    assert torch.autograd.gradcheck(chamfer_distance, (first, second))


def test_the_gradient_of_equal_clouds_is_zero_not_nan():
    first, _ = clouds()
    moved = first.clone().requires_grad_()
    chamfer_distance(moved, first).sum().backward()
    assert torch.equal(moved.grad, torch.zeros_like(first))
