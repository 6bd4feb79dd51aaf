import numpy as np
import pytest
import torch

from regbench.geometry.se3 import euler_deg_from_rotation, transform
from regbench.protocols.draws import DCP_PRIOR
from regbench_latentcem.actions import motion_of
from regbench_latentcem.model import Configuration
from regbench_latentcem.sampling import TRAINED_RAD, Sampling, draw_actions, draw_sample, variations


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
    """Points keep their order, so that what noise did to each of them can be read off."""
    sample, unit = draw(cloud, noisy=1.0), np.linalg.norm(cloud - cloud.mean(axis=0), axis=1).max()
    of_the_source = (sample["source"] - draw(cloud, noisy=0.0)["source"]) * unit
    assert of_the_source.std() == pytest.approx(0.01, rel=0.1)
    assert np.abs(of_the_source).max() <= 0.05 + 1e-5
    moved = transform(motion_of(sample["actions"][0]), sample["source"])
    assert ((sample["copies"][0] - moved) * unit).std() == pytest.approx(0.01 * 2**0.5, rel=0.1)


def test_motions_are_the_benchmarks_but_the_last_copys_are_of_the_whole_trained_range(cloud):
    samples = [draw(cloud, seed) for seed in range(200)]
    actions = np.stack([sample["actions"] for sample in samples])
    turn = motion_of([np.pi / 8] * 3 + [0.0] * 3)  # of the source, before any action
    motions = [euler_deg_from_rotation((motion_of(each) @ turn)[:3, :3]) for each in actions[:, :-1].reshape(-1, 6)]
    assert -1e-3 <= np.min(motions) < 1
    assert 44 < np.max(motions) <= 45.001
    for angles in (actions[:, -1, :3], np.stack([sample["proposed"] for sample in samples])[..., :3]):
        assert -0.55 <= angles.min() < -0.53
        assert 0.53 < angles.max() <= 0.55


def test_the_planner_searches_where_the_motions_are(cloud):
    """From its start, with a spread that is a little greater than theirs."""
    configuration = Configuration()
    rotations = motion_of([configuration.start_rad] * 3 + [0.0] * 3)[:3, :3]
    np.testing.assert_allclose(rotations, DCP_PRIOR.mean_T_target_source()[:3, :3], atol=1e-9)
    actions = np.concatenate([draw(cloud, seed)["actions"][:-1] for seed in range(400)])
    assert np.abs(actions.mean(axis=0)).max() < 0.03
    spread = actions.std(axis=0)
    assert (spread[:3] < configuration.action_deviation_rad).all()
    assert (spread[:3] > 0.75 * configuration.action_deviation_rad).all()
    assert spread[3:] == pytest.approx(configuration.action_deviation_translation, abs=0.002)
    torch.manual_seed(0)
    assert draw_actions((10_000,)).abs().amax(dim=0)[:3].tolist() == pytest.approx([TRAINED_RAD] * 3, abs=1e-3)


def test_near_actions_are_about_the_motion_that_made_the_target(cloud):
    offsets = np.concatenate([draw(cloud, s)["near"] - draw(cloud, s)["actions"][:2, None] for s in range(100)])
    assert np.abs(np.median(offsets[..., :3])) < 0.01
    assert 0.05 < np.abs(offsets[..., :3]).mean() < 0.4


def test_a_sample_is_a_function_of_its_generator(cloud):
    for name, values in draw(cloud).items():
        assert np.array_equal(values, draw(cloud)[name])
        assert values.dtype == np.float32


def test_variations_stretch_turn_and_mirror():
    maps = variations(torch.rand(2000, 7, dtype=torch.float64, generator=torch.Generator().manual_seed(0)))
    stretches = torch.linalg.svdvals(maps)
    assert 1 / 1.3 <= stretches.min() < 0.78
    assert 1.28 < stretches.max() <= 1.3
    assert (maps.det() < 0).double().mean().item() == pytest.approx(0.5, abs=0.05)
    unchanged = variations(torch.tensor([0.5, 0.5, 0.5, 0.9, 0.5, 0.5, 0.5]))
    torch.testing.assert_close(unchanged, torch.eye(3))


def test_a_varied_sample_is_another_cloud_of_the_same_extent(cloud):
    plain, varied = draw(cloud, noisy=0.0), draw(cloud, noisy=0.0, varied=True)
    assert np.linalg.norm(varied["source"], axis=1).max() == pytest.approx(1, abs=1e-6)
    spreads = [np.linalg.svd(sample["source"], compute_uv=False) for sample in (plain, varied)]
    assert np.abs(spreads[0] / spreads[1] - 1).max() > 0.02
    for copy, action in zip(varied["copies"], varied["actions"], strict=True):
        np.testing.assert_allclose(copy, transform(motion_of(action), varied["source"]), atol=1e-5)
