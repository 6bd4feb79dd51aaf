import pytest
import torch
from torch.nn import functional

from regbench.learning.layers.linear_max import linear_max, linear_winners


def case(dtype):
    generator = torch.Generator().manual_seed(0)
    points, weight, bias = (torch.randn(*shape, generator=generator) for shape in ((3, 50, 6), (9, 6), (9,)))
    return [tensor.to(dtype).requires_grad_() for tensor in (points, weight, bias)]


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.float64, 1e-12)])
def test_value_and_gradients_are_those_of_a_layer_and_a_maximum(dtype, tolerance):
    ours, theirs = case(dtype), case(dtype)
    answer, expected = linear_max(*ours), functional.linear(*theirs).amax(dim=1)
    torch.testing.assert_close(answer, expected, rtol=0, atol=tolerance)
    (answer**2).sum().backward()
    (expected**2).sum().backward()
    for our, their in zip(ours, theirs, strict=True):
        torch.testing.assert_close(our.grad, their.grad, rtol=tolerance, atol=10 * tolerance)


def test_its_gradients_are_those_of_finite_differences():
    assert torch.autograd.gradcheck(linear_max, case(torch.float64))


def test_one_point_that_wins_twice_gets_both_gradients():
    points = torch.tensor([[[1.0], [0.0]]], requires_grad=True)
    linear_max(points, torch.tensor([[2.0], [3.0]]), torch.zeros(2)).sum().backward()
    assert points.grad.flatten().tolist() == [5.0, 0.0]


def test_winners_are_where_the_maxima_are_in_layers_of_any_width():
    generator = torch.Generator().manual_seed(0)
    points, weight = torch.randn(2, 40, 5, generator=generator), torch.randn(600, 5, generator=generator)
    highest, winners = linear_winners(points, weight)
    values = points @ weight.T
    torch.testing.assert_close(highest, values.amax(dim=1))
    assert torch.equal(winners, values.argmax(dim=1))
