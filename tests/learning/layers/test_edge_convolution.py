import pytest
import torch
from torch.nn import functional

from regbench.learning.layers.edge_convolution import EdgeConvolution
from regbench.learning.layers.neighbours import nearest_neighbours

K = 8


def naive(layer, features):
    """The definition: a linear map of [x_j - x_i, x_i] on every edge, LeakyReLU, then the maximum."""
    neighbours = nearest_neighbours(features, K)
    of_neighbours = torch.stack([cloud[indices] for cloud, indices in zip(features, neighbours, strict=True)])
    centre = features[:, :, None, :].expand_as(of_neighbours)
    edges = layer.edge(torch.cat([of_neighbours - centre, centre], dim=3))
    return functional.leaky_relu(edges, layer.slope).amax(dim=2)


def case(dtype, channels=5):
    torch.manual_seed(0)
    layer = EdgeConvolution(channels, 16).to(dtype)
    torch.nn.init.normal_(layer.edge.bias)
    return layer, torch.randn(2, 100, channels, dtype=dtype)


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.float64, 1e-12)])
def test_it_equals_the_naive_form(dtype, tolerance):
    layer, features = case(dtype)
    torch.testing.assert_close(layer(features, K), naive(layer, features), rtol=0, atol=tolerance)


def test_its_gradients_equal_those_of_the_naive_form():
    layer, features = case(torch.float32)
    gradients = []
    for form in (lambda x: layer(x, K), lambda x: naive(layer, x)):
        x = features.clone().requires_grad_()
        layer.zero_grad()
        (form(x) ** 2).mean().backward()
        gradients.append([x.grad, layer.edge.weight.grad.clone(), layer.edge.bias.grad.clone()])
    for ours, theirs in zip(*gradients, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-6)


def test_its_gradients_are_those_of_finite_differences():
    torch.manual_seed(0)
    layer = EdgeConvolution(3, 4).double()
    assert torch.autograd.gradcheck(
        lambda x: layer(x, 3), torch.randn(1, 12, 3, dtype=torch.float64, requires_grad=True)
    )


def test_layer_norm_follows_the_maximum():
    torch.manual_seed(0)
    layer = EdgeConvolution(3, 16, normalisation="layer", slope=1.0)  # slope 1: no activation
    answer = layer(torch.randn(2, 50, 3), K)
    torch.testing.assert_close(answer.mean(dim=2), torch.zeros(2, 50), rtol=0, atol=1e-5)
    torch.testing.assert_close(answer.var(dim=2, unbiased=False), torch.ones(2, 50), rtol=0, atol=1e-2)
