import pytest
import torch
from torch import nn

from regbench.learning.layers.pointnet import PointNet, per_point, pooled

WIDTHS = (16, 24, 40)


def network(normalisation="batch", widths=WIDTHS, dtype=torch.float64):
    """A network as after some training: statistics, scales (some negative) and shifts that are not the first ones."""
    torch.manual_seed(0)
    made = PointNet(widths, normalisation=normalisation).to(dtype)
    for norm in made.norms:
        for values in (norm.weight, norm.bias, norm.running_mean):
            nn.init.normal_(values)
        nn.init.uniform_(norm.running_var, 0.5, 2)
    return made


def plain(made):
    """The same parameters in torch's own layers, as PointNetLK's code has them."""
    layers = []
    for i, linear in enumerate(made.linear):
        convolution = nn.Conv1d(linear.in_features, linear.out_features, 1).to(linear.weight.dtype)
        convolution.load_state_dict({"weight": linear.weight[:, :, None], "bias": linear.bias})
        layers += [convolution]
        if made.norms:
            layers += [nn.BatchNorm1d(linear.out_features).to(linear.weight.dtype)]
            layers[-1].load_state_dict(made.norms[i].state_dict())
        layers += [nn.ReLU()]
    return nn.Sequential(*layers).train(made.training)


def clouds(dtype=torch.float64, points=50):
    return torch.randn(3, points, 3, generator=torch.Generator().manual_seed(1)).to(dtype)


@pytest.mark.parametrize("normalisation", ["batch", "none"])
@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-4), (torch.float64, 1e-11)])
def test_values_gradients_and_statistics_are_those_of_the_plain_layers(normalisation, training, dtype, tolerance):
    ours = network(normalisation, dtype=dtype).train(training)
    theirs = plain(ours)
    near, far = clouds(dtype).requires_grad_(), clouds(dtype).requires_grad_()
    found, expected = ours(near), theirs(far.transpose(1, 2)).max(dim=2).values
    torch.testing.assert_close(found, expected, rtol=0, atol=tolerance)
    (found**2).sum().backward()
    (expected**2).sum().backward()
    torch.testing.assert_close(near.grad, far.grad, rtol=tolerance, atol=10 * tolerance)
    for i, linear in enumerate(ours.linear):
        step = 3 if ours.norms else 2
        gradient = theirs[step * i].weight.grad[:, :, 0]
        torch.testing.assert_close(linear.weight.grad, gradient, rtol=tolerance, atol=10 * tolerance)
        if ours.norms:
            for name, state in theirs[step * i + 1].state_dict().items():
                torch.testing.assert_close(ours.norms[i].state_dict()[name], state, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("normalisation", ["batch", "none"])
def test_the_folded_layers_are_the_network(normalisation):
    made = network(normalisation).eval()
    layers = made.folded()
    assert [tuple(weight.shape) for weight, _ in layers] == [(16, 3), (24, 16), (40, 24)]
    expected = plain(made)(clouds().transpose(1, 2)).transpose(1, 2)
    torch.testing.assert_close(per_point(layers, clouds()), expected)
    torch.testing.assert_close(made.features(clouds()), expected)
    torch.testing.assert_close(pooled(layers, clouds()), expected.amax(dim=1))
    with torch.no_grad():
        torch.testing.assert_close(pooled(layers, clouds()), expected.amax(dim=1))


def test_features_before_the_maximum_are_those_that_are_pooled_in_training():
    made = network().train()
    torch.testing.assert_close(made.features(clouds()).amax(dim=1), made(clouds()))


@pytest.mark.parametrize("training", [True, False])
def test_the_order_of_the_points_does_not_matter(training):
    made = network().train(training)
    torch.testing.assert_close(made(clouds()[:, torch.randperm(50)]), made(clouds()))


def test_points_and_layers_are_not_changed():
    made, points = network(widths=(8,)).eval(), clouds()
    with torch.no_grad():
        pooled(made.folded(), points)
    assert torch.equal(points, clouds())


def test_folding_passes_gradients_to_every_parameter():
    made = network().eval()
    made(clouds()).sum().backward()
    assert all(parameter.grad is not None for parameter in made.parameters())
