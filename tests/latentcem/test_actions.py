import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from regbench.geometry.se3 import euler_deg_from_rotation, rotation_from_euler_deg, transform
from regbench_latentcem.actions import action_of, motion_of, move, rotations_of


def random_actions(count=200):
    return torch.randn(count, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64)


def test_rotations_are_those_of_the_protocols_and_of_scipy():
    actions = random_actions()
    rotations = rotations_of(actions).numpy()
    for action, rotation in zip(actions.numpy(), rotations, strict=True):
        np.testing.assert_allclose(rotation, rotation_from_euler_deg(np.degrees(action[:3])), atol=1e-14)
    scipys = Rotation.from_euler("zyx", actions[:, [2, 1, 0]].numpy()).as_matrix()
    np.testing.assert_allclose(rotations, scipys, atol=1e-14)


def test_an_action_moves_points_as_its_motion_does():
    clouds = torch.randn(200, 10, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    actions = random_actions()
    for cloud, action, moved in zip(clouds, actions, move(clouds, actions), strict=True):
        np.testing.assert_allclose(moved, transform(motion_of(action), cloud), atol=1e-14)


def test_each_point_by_hand():
    quarter = torch.tensor([0, 0, torch.pi / 2, 1, 2, 3], dtype=torch.float64)  # about z: x goes to y
    moved = move(torch.tensor([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=torch.float64), quarter)
    np.testing.assert_allclose(moved, [[1, 3, 3], [0, 2, 3], [1, 2, 4]], atol=1e-15)


def test_motions_and_actions_go_there_and_back():
    for action in random_actions().numpy():
        motion = motion_of(action)
        np.testing.assert_allclose(motion_of(action_of(motion)), motion, atol=1e-12)
    small = random_actions().numpy() * 0.4
    np.testing.assert_allclose([action_of(motion_of(action)) for action in small], small, atol=1e-12)


def test_the_metrics_read_the_same_angles():
    action = np.array([0.3, -0.2, 0.5, 0, 0, 0])
    angles_deg = euler_deg_from_rotation(motion_of(action)[:3, :3])
    assert np.radians(angles_deg) == pytest.approx(action[:3])
