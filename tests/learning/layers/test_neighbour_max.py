import pytest
import torch

from regbench.learning.layers.neighbour_max import neighbour_max


def random_case(dtype, clouds=3, points=50, channels=7, k=6):
    generator = torch.Generator().manual_seed(0)
    values = torch.randn(clouds, points, channels, generator=generator).to(dtype)
    neighbours = torch.randint(points, (clouds, points, k), generator=generator)
    return values, neighbours


def naive(values, neighbours):
    return torch.stack([cloud[indices].amax(dim=1) for cloud, indices in zip(values, neighbours, strict=True)])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64, torch.bfloat16])
def test_it_is_the_maximum_over_the_gathered_neighbours(dtype):
    values, neighbours = random_case(dtype)
    assert torch.equal(neighbour_max(values, neighbours), naive(values, neighbours))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_its_gradient_is_that_of_the_naive_form(dtype):
    values, neighbours = random_case(dtype)
    weights = torch.randn(values.shape, generator=torch.Generator().manual_seed(1)).to(dtype)
    ours, theirs = values.clone().requires_grad_(), values.clone().requires_grad_()
    (neighbour_max(ours, neighbours) * weights).sum().backward()
    (naive(theirs, neighbours) * weights).sum().backward()
    torch.testing.assert_close(ours.grad, theirs.grad)


def test_its_gradient_is_that_of_finite_differences():
    values, neighbours = random_case(torch.float64, clouds=2, points=8, channels=3, k=3)
    assert torch.autograd.gradcheck(lambda v: neighbour_max(v, neighbours), values.requires_grad_())


def test_compiled_and_torch_passes_pick_the_same_winner_among_equals():
    neighbours = torch.tensor([[[2, 0, 1]]])
    for dtype in (torch.float32, torch.float64):
        values = torch.ones(1, 3, 1, dtype=dtype, requires_grad=True)
        neighbour_max(values, neighbours).sum().backward()
        assert values.grad.flatten().tolist() == [0, 0, 1]


def test_values_that_are_not_contiguous_are_read_right():
    values, neighbours = random_case(torch.float32)
    transposed = values.transpose(1, 2).contiguous().transpose(1, 2)
    assert torch.equal(neighbour_max(transposed, neighbours), naive(values, neighbours))


@pytest.mark.parametrize("index", [-1, 50])
def test_an_index_outside_the_cloud_is_refused(index):
    values, neighbours = random_case(torch.float32)
    neighbours[1, 2, 3] = index
    with pytest.raises(ValueError, match="outside the 50 points"):
        neighbour_max(values, neighbours)


def test_shapes_that_do_not_fit_are_refused():
    values, neighbours = random_case(torch.float32)
    with pytest.raises(ValueError, match="neighbour_max needs"):
        neighbour_max(values, neighbours[:2])
