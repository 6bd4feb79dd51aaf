import numpy as np
import pytest
import torch

from regbench.learning.layers.pointnet import per_point, pooled
from regbench.learning.layers.pointnet_jacobian import pointnet_jacobian
from regbench.learning.layers.se3_exponential import se3_exp


def layers_of(widths=(16, 24, 300), dtype=torch.float64, seed=0):
    rng = np.random.default_rng(seed)
    sizes = zip((3, *widths), widths, strict=False)
    return [
        tuple(
            torch.from_numpy(rng.normal(size=shape) * scale).to(dtype) for shape, scale in (((n, m), m**-0.5), (n, 0.3))
        )
        for m, n in sizes
    ]


def clouds(batch=3, points=60, dtype=torch.float64):
    return torch.from_numpy(np.random.default_rng(1).normal(size=(batch, points, 3))).to(dtype)


def moved_features(layers, points, twist):
    """The features of clouds moved by one twist, by the last layer's every feature and a plain maximum."""
    T = se3_exp(twist[None])[0]
    return per_point(layers, points @ T[:3, :3].T + T[:3, 3]).amax(dim=1)


@pytest.mark.parametrize("widths", [(16, 24, 300), (32, 5), (7,), (64, 64, 64, 128, 1024)])
def test_features_and_jacobian_are_those_of_finite_differences(widths):
    layers, points, step = layers_of(widths), clouds(), 1e-6
    features, jacobian = pointnet_jacobian(layers, points)
    torch.testing.assert_close(features, pooled(layers, points))
    steps = step * torch.eye(6, dtype=torch.float64)
    columns = [(moved_features(layers, points, s) - moved_features(layers, points, -s)) / (2 * step) for s in steps]
    torch.testing.assert_close(jacobian, torch.stack(columns, dim=2), rtol=0, atol=1e-7)


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-4), (torch.float64, 1e-12)])
def test_the_jacobian_is_torchs(dtype, tolerance):
    layers, points = layers_of((16, 24, 40), dtype=dtype), clouds(points=30, dtype=dtype)
    found = pointnet_jacobian(layers, points)[1]
    expected = torch.func.jacrev(lambda twist: moved_features(layers, points, twist))(torch.zeros(6, dtype=dtype))
    torch.testing.assert_close(found, expected, rtol=0, atol=tolerance)


def test_a_feature_that_relu_cuts_off_everywhere_is_flat():
    (weight, bias), *_ = layers_of((8,))
    features, jacobian = pointnet_jacobian([(weight, bias - 100)], clouds())
    assert features.abs().max() == jacobian.abs().max() == 0


def test_one_point_wins_all():
    layers, points = layers_of(), clouds(points=1)
    torch.testing.assert_close(pointnet_jacobian(layers, points)[0], per_point(layers, points)[:, 0])


def test_clouds_of_a_batch_do_not_meet():
    layers, points = layers_of(), clouds()
    together = pointnet_jacobian(layers, points)
    for b in range(3):
        for all_of_them, alone in zip(together, pointnet_jacobian(layers, points[b : b + 1]), strict=True):
            torch.testing.assert_close(all_of_them[b : b + 1], alone)


def test_its_gradients_are_those_of_finite_differences():
    layers, points = layers_of((6, 9)), clouds(batch=2, points=5).requires_grad_()
    parameters = [parameter.requires_grad_() for layer in layers for parameter in layer]

    def function(points, *parameters):
        return pointnet_jacobian([parameters[:2], parameters[2:]], points)

    assert torch.autograd.gradcheck(function, (points, *parameters))
