"""ICP from many starts: the best of what ICP finds from each, within its limits."""

from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
from regbench_baselines import icp_restarts
from regbench_baselines.icp import Icp
from regbench_baselines.icp_restarts import IcpRestarts
from scipy.spatial.transform import Rotation

from regbench import Problem
from regbench.geometry.chamfer import chamfer_distance
from regbench.geometry.icp import icp
from regbench.geometry.se3 import euler_deg_from_rotation, se3, transform
from regbench.geometry.size import extent
from regbench.registry import MethodRegistry, parse_methods
from regbench.testing import assert_conforms
from regbench.testing.clouds import body, easy_problem, make_problem


@pytest.fixture
def turned():
    """A cloud and its copy turned by 150 degrees, from where ICP alone ends far off, with the truth."""
    cloud = body(300)
    truth = se3(Rotation.from_rotvec(np.radians(150) * np.array([0.6, 0, 0.8])).as_matrix(), np.array([0.3, 0, -0.2]))
    rng = np.random.default_rng(0)
    return make_problem(cloud, transform(truth, rng.permutation(cloud)), seed=4), truth


def rotations(problem, count, **parameters):
    method = IcpRestarts(**parameters)
    return np.array(list(islice(method._rotations(problem, np.random.default_rng(problem.seed)), count)))


def test_it_is_installed_under_its_name():
    assert MethodRegistry().resolve(parse_methods(["icp_restarts"])[0]).cls is IcpRestarts


@pytest.mark.parametrize("parameters", [{"budget_ms": 30.0}, {"budget_ms": None, "restarts": 4, "starts": "prior"}])
def test_conforms(parameters):
    assert_conforms(IcpRestarts, parameters)


def test_without_restarts_it_is_icp_from_matched_centroids(turned):
    problem, _ = turned
    answer = IcpRestarts(budget_ms=None, restarts=0).register(problem)
    np.testing.assert_array_equal(answer.T_target_source, Icp(backend="numba").register(problem).T_target_source)
    assert answer.iterations == 1


def test_a_start_given_by_the_problem_comes_first(turned):
    problem, truth = turned
    answer = IcpRestarts(budget_ms=None, restarts=0).register(replace(problem, init_T_target_source=truth))
    np.testing.assert_allclose(answer.T_target_source, truth, atol=1e-9)


def test_more_starts_find_what_one_does_not_and_never_answer_worse(turned):
    problem, truth = turned
    answers = [IcpRestarts(budget_ms=None, restarts=n).register(problem) for n in (0, 4, 40)]
    distances = [-answer.confidence for answer in answers]
    assert distances == sorted(distances, reverse=True)
    assert np.abs(answers[0].T_target_source - truth).max() > 0.1
    np.testing.assert_allclose(answers[-1].T_target_source, truth, atol=1e-9)


def test_the_confidence_is_minus_the_chamfer_distance_in_extents():
    source = body(300)
    noise = np.random.default_rng(0).normal(0, 0.01, source.shape)
    problem = make_problem(source * 3, source * 3 + noise)
    answer = IcpRestarts(budget_ms=None, restarts=2).register(problem)
    moved = transform(answer.T_target_source, problem.source)
    expected = chamfer_distance(moved, problem.target) / extent(problem.target)
    assert answer.confidence == pytest.approx(-expected, rel=1e-9)


def test_the_seed_decides_what_is_drawn(turned):
    problem, _ = turned
    method = IcpRestarts(budget_ms=None, restarts=3, max_iterations=1)
    first, again, other = (method.register(replace(problem, seed=seed)) for seed in (1, 1, 2))
    assert first.T_target_source.tobytes() == again.T_target_source.tobytes()
    assert first.T_target_source.tobytes() != other.T_target_source.tobytes()


def test_uniform_starts_cover_all_rotations():
    drawn = rotations(easy_problem()[0], 4000)
    # Uniform on SO(3): the angle's density is (1 - cos t) / pi, its mean pi/2 + 2/pi; no direction is preferred.
    assert np.degrees(Rotation.from_matrix(drawn).magnitude()).mean() == pytest.approx(126.5, abs=2)
    assert np.abs(drawn.mean(axis=0)).max() < 0.04


def test_starts_of_the_prior_fill_its_range():
    problem, _ = easy_problem()
    prior = problem.motion_prior
    angles = np.array([euler_deg_from_rotation(R) for R in rotations(problem, 500, starts="prior")])
    least, greatest = np.array(prior.angle_min_deg), np.array(prior.angle_max_deg)
    assert (angles >= least - 1e-9).all()
    assert (angles <= greatest + 1e-9).all()
    np.testing.assert_allclose(angles.min(axis=0), least, atol=0.02 * (greatest - least).max())
    np.testing.assert_allclose(angles.max(axis=0), greatest, atol=0.02 * (greatest - least).max())


def test_without_a_prior_starts_prior_is_skipped_with_a_reason():
    problem = replace(easy_problem()[0], motion_prior=None)
    method = IcpRestarts(starts="prior")
    assert method.skip(problem) == "starts=prior needs a motion prior, and the protocol discloses none"
    assert IcpRestarts().skip(problem) is None
    with pytest.raises(ValueError, match="starts=prior needs a motion prior"):
        method.register(problem)


def test_one_of_the_two_limits_is_needed():
    with pytest.raises(ValueError, match="needs a limit: budget_ms or restarts"):
        IcpRestarts(budget_ms=None).register(easy_problem()[0])


def test_a_cloud_without_points_is_named():
    with pytest.raises(ValueError, match="the source cloud has no points"):
        IcpRestarts().register(Problem(source=np.empty((0, 3)), target=np.eye(3)))


@pytest.mark.parametrize(("budget_ms", "tried"), [(0.0, 1), (19.0, 1), (20.0, 2), (55.0, 5), (None, 8)])
def test_no_start_is_begun_that_would_end_after_the_budget(monkeypatch, turned, budget_ms, tried):
    """By a clock on which every ICP takes 10 ms."""
    clock = SimpleNamespace(now_s=0.0)

    def slow_icp(*arguments, **options):
        clock.now_s += 0.010
        return icp(*arguments, **options)

    monkeypatch.setattr(icp_restarts, "icp", slow_icp)
    monkeypatch.setattr(icp_restarts, "time", SimpleNamespace(perf_counter=lambda: clock.now_s))
    answer = IcpRestarts(budget_ms=budget_ms, restarts=7, max_iterations=1).register(turned[0])
    assert answer.iterations == tried
