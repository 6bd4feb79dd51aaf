import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from regbench.geometry.se3 import transform
from regbench_latentcem.actions import motion_of
from regbench_latentcem.model import Configuration
from regbench_latentcem.sampling import Sampling, draw_actions, draw_sample


@pytest.fixture
def cloud():
    return np.random.default_rng(0).normal(size=(300, 3)) * [3, 1, 0.5] + 10


def draw(cloud, seed=1, **settings):
    return draw_sample(cloud, 200, Sampling(**settings), np.random.default_rng(seed))


def test_copies_are_the_source_after_their_actions(cloud):
    sample = draw(cloud, noisy=0.0)
    for copy, action in zip(sample["copies"], sample["actions"], strict=True):
        np.testing.assert_allclose(copy, transform(motion_of(action), sample["source"]), atol=1e-5)


def test_the_source_is_centred_and_of_unit_extent(cloud):
    source = draw(cloud, noisy=0.0)["source"]
    np.testing.assert_allclose(source.mean(axis=0), 0, atol=1e-6)
    assert np.linalg.norm(source, axis=1).max() == pytest.approx(1, abs=1e-6)


def test_noise_is_of_the_protocols_size_and_of_each_cloud_its_own(cloud):
    sample, unit = draw(cloud, noisy=1.0), np.linalg.norm(cloud - cloud.mean(axis=0), axis=1).max()
    clean = draw(cloud, noisy=0.0)
    moved = transform(motion_of(sample["actions"][0]), sample["source"])
    residuals = cKDTree(sample["copies"][0]).query(moved)[0]
    assert 0 < np.median(residuals) * unit < 0.05
    assert not np.allclose(sample["source"], clean["source"], atol=1e-4)


def test_angles_are_the_benchmarks_but_the_last_copys_are_of_the_whole_trained_range(cloud):
    samples = [draw(cloud, seed) for seed in range(200)]
    actions = np.stack([sample["actions"] for sample in samples])
    assert actions[:, :-1, :3].min() >= 0
    assert actions[:, :-1, :3].max() <= np.pi / 4
    for angles in (actions[:, -1, :3], np.stack([sample["proposed"] for sample in samples])[..., :3]):
        assert -0.3 <= angles.min() < -0.25
        assert np.pi / 4 + 0.25 < angles.max() <= np.pi / 4 + 0.3


def test_the_configuration_tells_the_planner_the_trained_range():
    torch.manual_seed(0)
    actions, configuration = draw_actions((100_000,)), Configuration()
    assert actions[:, :3].mean().item() == pytest.approx(configuration.action_mean_rad, abs=0.005)
    assert actions[:, :3].std().item() == pytest.approx(configuration.action_deviation_rad, abs=0.005)
    assert actions[:, 3:].std().item() == pytest.approx(configuration.action_deviation_translation, abs=0.001)


def test_near_actions_are_about_the_motion_that_made_the_target(cloud):
    offsets = np.concatenate([draw(cloud, s)["near"] - draw(cloud, s)["actions"][:2, None] for s in range(100)])
    assert np.abs(np.median(offsets[..., :3])) < 0.01
    assert 0.05 < np.abs(offsets[..., :3]).mean() < 0.4


def test_a_sample_is_a_function_of_its_generator(cloud):
    for name, values in draw(cloud).items():
        assert np.array_equal(values, draw(cloud)[name])
        assert values.dtype == np.float32
