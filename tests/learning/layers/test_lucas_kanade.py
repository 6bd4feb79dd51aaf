"""The Lucas-Kanade loop: its direction, its Jacobians, and that gradients go through it."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from regbench.geometry.se3 import se3
from regbench.learning.layers.lucas_kanade import lucas_kanade, numerical_jacobian, pose_loss
from regbench.learning.layers.pointnet import PointNet, pooled
from regbench.learning.layers.pointnet_jacobian import pointnet_jacobian
from regbench.testing.clouds import body

TRUTH = se3(Rotation.from_rotvec([0.15, -0.2, 0.1]).as_matrix(), [0.05, -0.02, 0.03])


@pytest.fixture(scope="module")
def layers():
    torch.manual_seed(0)
    return PointNet((64, 64, 512), normalisation="none").double().requires_grad_(False).folded()


def pair(count=300):
    source = body(count)
    target = source @ TRUTH[:3, :3].T + TRUTH[:3, 3]
    return tuple(torch.from_numpy(cloud)[None] for cloud in (source, np.random.default_rng(0).permutation(target)))


@pytest.mark.parametrize("jacobian", ["analytical", "numerical"])
def test_it_finds_t_target_source_and_not_its_inverse(layers, jacobian):
    visited, residual = lucas_kanade(layers, *pair(), iterations=30, jacobian=jacobian)
    np.testing.assert_allclose(visited[-1][0], TRUTH, atol=1e-6)
    assert residual.abs().max() < 1e-6


def test_the_first_update_is_the_least_squares_step_of_finite_differences(layers):
    source, target = pair()
    features = pooled(layers, target)
    J = numerical_jacobian(layers, target, features, 1e-7)[0].numpy()
    twist = np.linalg.lstsq(J, (features - pooled(layers, source))[0].numpy(), rcond=None)[0]
    (T,), _ = lucas_kanade(layers, source, target, iterations=1)
    np.testing.assert_allclose(T[0, :3, :3], Rotation.from_rotvec(twist[:3]).as_matrix(), atol=1e-5)


def test_both_jacobians_agree(layers):
    cloud, _ = pair()
    features, analytical = pointnet_jacobian(layers, cloud)
    torch.testing.assert_close(numerical_jacobian(layers, cloud, features, 1e-6), analytical, atol=1e-4, rtol=0)


def test_it_stops_where_the_motion_has_settled(layers):
    visited, _ = lucas_kanade(layers, *pair(), iterations=100, tolerance=1e-9)
    assert 3 < len(visited) < 60


def test_a_batch_is_its_clouds_one_by_one(layers):
    source, target = pair()
    both = lucas_kanade(layers, torch.cat([source, target]), torch.cat([target, target]), iterations=4)[0][-1]
    alone = lucas_kanade(layers, source, target, iterations=4)[0][-1]
    torch.testing.assert_close(both[0], alone[0])
    torch.testing.assert_close(both[1], torch.eye(4, dtype=torch.float64), atol=1e-9, rtol=0)


@pytest.mark.parametrize("cloud", [np.zeros((5, 3)), np.outer(np.linspace(-1, 1, 9), [1.0, 2.0, 0.0]), body(3)])
def test_degenerate_clouds_get_a_finite_motion(layers, cloud):
    points = torch.from_numpy(cloud)[None]
    visited, _ = lucas_kanade(layers, points, points.flip(1), iterations=5)
    assert torch.isfinite(visited[-1]).all()


def test_gradients_go_through_the_loop():
    torch.manual_seed(1)
    network = PointNet((8, 16), normalisation="none").double()
    source, target = pair(20)
    truth = torch.from_numpy(TRUTH)[None]
    weight = next(network.parameters())

    def loss():
        return pose_loss(lucas_kanade(network.folded(), source, target, iterations=3)[0][-1], truth).sum()

    loss().backward()
    step = 1e-6
    for index in ((0, 0), (3, 1), (5, 2)):
        with torch.no_grad():
            weight[index] += step
            above = float(loss())
            weight[index] -= 2 * step
            below = float(loss())
            weight[index] += step
        assert weight.grad[index] == pytest.approx((above - below) / (2 * step), rel=1e-3, abs=1e-7)


def test_no_iteration_is_refused(layers):
    with pytest.raises(ValueError, match="iterations"):
        lucas_kanade(layers, *pair(), iterations=0)


def test_with_descent_the_difference_of_features_never_grows(layers):
    source, target = pair()
    turned = source @ torch.from_numpy(Rotation.from_rotvec([1.0, 0.8, -0.9]).as_matrix()).T
    visited, residual = lucas_kanade(layers, turned, target, iterations=15, descent=True)
    features = pooled(layers, target)
    differences = [
        float((features - pooled(layers, turned @ T[:, :3, :3].mT + T[:, None, :3, 3])).square().sum()) for T in visited
    ]
    assert differences == sorted(differences, reverse=True)
    assert float(residual.square().sum()) == pytest.approx(differences[-1])
    np.testing.assert_allclose(
        lucas_kanade(layers, source, target, iterations=40, descent=True)[0][-1][0], TRUTH, atol=1e-6
    )
