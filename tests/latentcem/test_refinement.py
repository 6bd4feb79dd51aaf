import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from regbench.contract import MotionPrior
from regbench.geometry.icp import icp
from regbench.geometry.se3 import rotation_from_euler_deg, se3, transform
from regbench.testing.clouds import body
from regbench_latentcem.refinement import Residuals, angle_deg, inside, octants, verified

QUARTERS = np.array([[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]])


def turn(degrees, axis=(0.0, 0.0, 1.0)):
    return se3(Rotation.from_rotvec(np.radians(degrees) * np.array(axis)).as_matrix(), np.zeros(3))


def centred(points=400):
    cloud = body(points)
    return (cloud - cloud.mean(axis=0)) / np.ptp(cloud, axis=0).max()


def square(rng):
    """Two samples of 1,000 points on the outline of a square."""
    for _ in range(2):
        along = rng.uniform(-1, 1, 1000)
        outline = np.column_stack([along, np.ones(1000)])
        turns = rng.integers(0, 4, 1000)
        yield np.einsum("nij,nj->ni", QUARTERS[turns], outline)


def test_the_motion_of_least_residual_is_found_among_wrong_ones():
    source, truth = centred(), turn(70)
    candidates = [turn(degrees) for degrees in (0, 180, 130, 75, -60)]
    found = verified(candidates, source, transform(truth, source), 100)
    np.testing.assert_allclose(found.T_target_source, truth, atol=1e-9)
    assert found.residual < 1e-9
    assert found.covered == 1


def test_points_that_are_there_twice_say_no_more_than_once():
    source, truth = centred(), turn(70)
    candidates = [turn(degrees) for degrees in (0, 180, 75)]
    twice = np.repeat(transform(truth, source), 2, axis=0)
    found = verified(candidates, np.repeat(source, 2, axis=0), twice, 100)
    np.testing.assert_allclose(found.T_target_source, truth, atol=1e-9)
    assert Residuals(source, twice).spacing == pytest.approx(Residuals(source, transform(truth, source)).spacing)


def test_a_target_of_one_point_has_no_spacing_and_all_distances_count():
    residuals = Residuals(centred(50), np.zeros((5, 3)))
    assert residuals.spacing == 0
    assert residuals.truncated(np.array([3.0, 4.0]), 1.0) == pytest.approx(12.5**0.5)


def test_the_order_of_the_candidates_behind_the_start_does_not_matter():
    source = centred()
    target = transform(turn(70), source) + np.random.default_rng(0).normal(0, 0.01, source.shape)
    rest = [turn(degrees) for degrees in (180, 130, 75, -60)]
    answers = [verified([turn(0), *order], source, target, 100) for order in (rest, rest[::-1])]
    np.testing.assert_allclose(answers[0].T_target_source, answers[1].T_target_source, atol=1e-12)


def test_of_motions_that_nothing_tells_apart_the_nearest_to_the_start_is_taken():
    """A square prism looks the same after a quarter turn; two samples of it are no copies."""
    rng = np.random.default_rng(0)
    source, target = (np.column_stack([side * 0.5, rng.uniform(-0.9, 0.9, len(side))]) for side in square(rng))
    target = transform(turn(10), target)
    for start in (0, 90, 180, 270):
        found = verified([turn(start), *(turn(90 * k + 12) for k in range(4))], source, target, 100)
        assert angle_deg(found.T_target_source, turn(start + 10)) < 5


def test_soft_matches_are_nearer_the_truth_than_icps_on_noisy_copies():
    rng, truth, errors = np.random.default_rng(0), turn(20), []
    for _ in range(8):
        source = centred(800) + rng.normal(0, 0.01, (800, 3))
        target = transform(truth, centred(800)) + rng.normal(0, 0.01, (800, 3))
        hard = icp(source, target, truth).T_target_source
        soft = verified([turn(0), hard], source, target, 100).T_target_source
        errors.append([angle_deg(hard, truth), angle_deg(soft, truth)])
    assert np.mean(errors, axis=0)[1] < 0.95 * np.mean(errors, axis=0)[0]


def test_crops_are_judged_by_what_they_share():
    """Each cloud lacks a third: the true motion leaves points without a partner, and wins over better coverage."""
    whole, truth = centred(900), se3(turn(30)[:3, :3], np.array([0.1, 0.05, 0.0]))
    source = whole[np.argsort(whole[:, 0])[:600]]
    target = transform(truth, whole[np.argsort(whole[:, 0])[300:]])
    shift = np.array([0.02, -0.02, 0.01])
    near = se3(truth[:3, :3] @ turn(4)[:3, :3], truth[:3, 3] + shift)
    centroids_matched = se3(truth[:3, :3], target.mean(axis=0) - truth[:3, :3] @ source.mean(axis=0))
    found = verified([centroids_matched, near], source, target, 100)
    np.testing.assert_allclose(found.T_target_source, truth, atol=5e-3)
    assert 0.4 < found.covered < 0.85


def test_what_is_not_allowed_is_not_answered():
    source, truth = centred(), turn(170)
    target = transform(truth, source)
    found = verified([turn(0), turn(168)], source, target, 100, allowed=lambda T: angle_deg(T, turn(0)) < 30)
    assert angle_deg(found.T_target_source, truth) > 5


@pytest.mark.parametrize("points", [1, 2, 3])
def test_a_few_points_are_no_error(points):
    source = centred()[:points]
    found = verified([np.eye(4)], source, source + 0.1, 10)
    assert np.isfinite(found.T_target_source).all()
    assert found.residual < 0.2


def test_residuals_by_brute_force():
    source, target, T = centred(60), centred(80) + 0.05, turn(20)
    pairs = np.linalg.norm(transform(T, source)[:, None] - target[None], axis=2)
    own = np.linalg.norm(target[:, None] - target[None], axis=2) + np.diag(np.full(80, np.inf))
    of = Residuals(source, target)
    expected = np.concatenate([pairs.min(axis=1), pairs.min(axis=0)])
    np.testing.assert_allclose(of.distances(T), expected, atol=1e-12)
    spacing = np.median(own.min(axis=1))
    assert of.spacing == pytest.approx(spacing)
    truncated = np.sqrt(np.mean(np.minimum(expected, 1.5 * spacing) ** 2))
    assert of.truncated(expected, 1.5) == pytest.approx(truncated)


def test_octants_lie_in_the_priors_range():
    prior = MotionPrior((0.0,) * 3, (45.0, 40.0, 20.0), (0.0,) * 3, (0.0,) * 3)
    motions = octants(prior)
    assert len(motions) == 8
    assert all(inside(prior, T) for T in motions)
    np.testing.assert_allclose(motions[0][:3, :3], rotation_from_euler_deg([11.25, 10, 5]), atol=1e-12)
    assert inside(prior, se3(rotation_from_euler_deg([45, 44, -5]), np.zeros(3)))
    assert not inside(prior, se3(rotation_from_euler_deg([45, 50, 10]), np.zeros(3)))
