import numpy as np
import torch

from regbench.geometry.se3 import transform
from regbench.testing.clouds import body
from regbench_latentcem.actions import motion_of, move
from regbench_latentcem.loading import load_matcher
from regbench_latentcem.matching import NEAREST, Matcher, consensus, local_descriptors

ACTION = np.array([0.4, -0.9, 2.0, 0.2, -0.1, 0.3])


def cloud(points=400):
    values = torch.from_numpy(body(points))
    return values / (values.amax(dim=0) - values.amin(dim=0)).max()


def test_no_rigid_motion_changes_the_descriptors():
    source = cloud()
    moved = move(source, torch.from_numpy(ACTION))
    torch.testing.assert_close(local_descriptors(moved), local_descriptors(source), rtol=0, atol=1e-6)


def test_matches_that_agree_are_found_among_many_that_do_not():
    """30 % of 300 matches are right; the others are anywhere."""
    rng = np.random.default_rng(0)
    X, T = rng.uniform(-0.5, 0.5, (300, 3)), motion_of(ACTION)
    Y = transform(T, X) + rng.normal(0, 0.005, (300, 3))
    Y[90:] = rng.uniform(-0.5, 0.5, (210, 3)) + T[:3, 3]
    motions = consensus(torch.from_numpy(X), torch.from_numpy(Y)).numpy()
    np.testing.assert_allclose(motions[0], T, atol=0.03)
    for motion in motions:
        np.testing.assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-9)
        assert np.linalg.det(motion[:3, :3]) > 0


def test_a_crop_is_found_in_the_whole_after_any_motion():
    whole = cloud(800)
    part = whole[whole[:, 0].argsort()[:500]]
    motions = load_matcher().motions(part, move(whole, torch.from_numpy(ACTION)))
    np.testing.assert_allclose(motions[0].numpy(), motion_of(ACTION), atol=0.1)


def test_clouds_of_a_few_points_and_of_many():
    matcher = Matcher()
    for points in (1, 2, NEAREST):
        assert matcher.motions(cloud()[:points], cloud()[:points]).shape[1:] == (4, 4)
    assert torch.isfinite(matcher.motions(cloud(4000), cloud(5000))).all()
    flat = cloud() * torch.tensor([1.0, 1.0, 0.0])
    assert torch.isfinite(matcher.motions(flat, flat)).all()
    same_place = torch.zeros(200, 3, dtype=torch.float64)
    assert torch.isfinite(matcher.motions(same_place, same_place)).all()
