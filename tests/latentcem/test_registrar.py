import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench import Problem
from regbench.contract import MotionPrior
from regbench.errors import UserError
from regbench.geometry.se3 import invert, transform
from regbench.geometry.size import extent
from regbench.learning.weights import card_path, save_weights
from regbench.testing import Outcome, check_registrar, clouds
from regbench_latentcem import weight_files
from regbench_latentcem.model import Configuration, LatentModel
from regbench_latentcem.registrar import LatentCem


def rotation_error_deg(T, truth):
    return np.degrees(Rotation.from_matrix((invert(T) @ truth)[:3, :3]).magnitude())


@pytest.fixture
def weights(tmp_path, monkeypatch):
    """Random weights of a small paper model, in the place of the package's."""
    torch.manual_seed(0)
    configuration = Configuration(transformation_widths=(64, 32), evaluation_widths=(32, 32))
    path = tmp_path / "modelnet40.safetensors"
    networks = LatentModel(configuration).without_decoder()
    save_weights(path, networks.state_dict(), {"configuration": configuration.as_card()})
    for suffix in (".safetensors", ".json"):
        shutil.copy(weight_files.FOLDER / f"matcher{suffix}", tmp_path)
    monkeypatch.setattr(weight_files, "FOLDER", tmp_path)
    return path


@pytest.mark.parametrize("refine", ["none", "verify"])
def test_the_equivariant_model_conforms(refine):
    parameters = {"model": "equivariant", "refine": refine, "restarts": 2, "N": 300}
    assert [result for result in check_registrar(LatentCem, parameters) if result.outcome is Outcome.FAILED] == []


def test_large_motions_are_found_by_the_planner_alone():
    problem, _ = clouds.easy_problem()
    for seed in range(3):
        truth = np.eye(4)
        truth[:3, :3] = Rotation.from_rotvec(np.random.default_rng(seed).normal(size=3)).as_matrix()
        moved = Problem(source=problem.source, target=transform(truth, problem.source), seed=seed)
        answer = LatentCem(model="equivariant").register(moved)
        assert rotation_error_deg(answer.T_target_source, truth) < 0.1


def test_no_iteration_answers_the_start():
    problem, truth = clouds.easy_problem()
    starts = {
        start: LatentCem(model="equivariant", start=start, T=0).register(problem).T_target_source
        for start in ("centroid", "prior", "closed_form")
    }
    centroid = starts["centroid"]
    np.testing.assert_allclose(centroid[:3, :3], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(transform(centroid, problem.source).mean(axis=0), problem.target.mean(axis=0))
    mean = problem.motion_prior.mean_T_target_source()
    np.testing.assert_allclose(starts["prior"][:3, :3], mean[:3, :3], atol=1e-12)
    assert rotation_error_deg(starts["closed_form"], truth) < 1e-5


def test_the_problems_own_start_replaces_the_centroid():
    problem, truth = clouds.easy_problem()
    given = clouds.make_problem(problem.source, problem.target, init_T_target_source=truth)
    np.testing.assert_allclose(LatentCem(model="equivariant", T=0).register(given).T_target_source, truth, atol=1e-12)


def test_icp_ends_exact_where_the_planner_alone_is_near():
    problem, truth = clouds.permuted_problem()
    alone = LatentCem(model="equivariant").register(problem)
    refined = LatentCem(model="equivariant", refine="icp").register(problem)
    assert 1e-9 < rotation_error_deg(alone.T_target_source, truth) < 0.1
    np.testing.assert_allclose(refined.T_target_source, truth, atol=1e-9)


def noisy_problem(crop=False, prior=None):
    """Noise on both clouds, and on demand each cloud cut to 70 %; in units of three."""
    rng = np.random.default_rng(0)
    source = clouds.body(800) * 3
    target = transform(clouds.EASY_T_TARGET_SOURCE, source)
    if crop:
        source = source[source @ rng.normal(size=3) > np.quantile(source @ np.array([1.0, 0.5, 0]), 0.3)]
        target = target[np.argsort(target[:, 2])[: int(0.7 * len(target))]]
    noise = (rng.normal(0, 0.01, cloud.shape) for cloud in (source, target))
    return clouds.make_problem(source + next(noise), target + next(noise), prior=prior)


def test_confidence_of_verify_is_minus_the_root_mean_square_residual_in_extents():
    problem = noisy_problem()
    answer = LatentCem(model="equivariant", refine="verify").register(problem)
    moved = transform(answer.T_target_source, problem.source)
    forth, back = cKDTree(problem.target).query(moved)[0], cKDTree(moved).query(problem.target)[0]
    expected = np.sqrt(np.mean(np.concatenate([forth, back]) ** 2)) / extent(problem.target)
    assert answer.confidence == pytest.approx(-expected, rel=1e-9)


def test_crops_are_aligned_by_candidates_from_matched_points():
    """The centroids of crops are not each other's, and the planner starts there."""
    answer = LatentCem(model="equivariant", refine="verify").register(noisy_problem(crop=True))
    assert rotation_error_deg(answer.T_target_source, clouds.EASY_T_TARGET_SOURCE) < 1.0
    alone = LatentCem(model="equivariant", refine="icp").register(noisy_problem(crop=True))
    assert rotation_error_deg(alone.T_target_source, clouds.EASY_T_TARGET_SOURCE) > 2.0


def test_verify_with_the_prior_answers_nothing_outside_of_it():
    """The truth lies outside the range that is disclosed: without the prior it is found, with it it is not."""
    wrong = MotionPrior((50.0, 50.0, 50.0), (80.0, 80.0, 80.0), (-1.0,) * 3, (1.0,) * 3)
    problem = noisy_problem(prior=wrong)
    free = LatentCem(model="equivariant", refine="verify").register(problem)
    assert rotation_error_deg(free.T_target_source, clouds.EASY_T_TARGET_SOURCE) < 1.0
    bound = LatentCem(model="equivariant", refine="verify", start="prior").register(problem)
    assert rotation_error_deg(bound.T_target_source, clouds.EASY_T_TARGET_SOURCE) > 5.0


def test_a_problem_without_a_prior_is_skipped_by_start_prior():
    problem = clouds.make_problem(np.eye(3), np.eye(3), prior=None)
    assert "discloses none" in LatentCem(start="prior").skip(problem)
    assert LatentCem().skip(problem) is None


def test_missing_weights_say_which_there_are(tmp_path, monkeypatch):
    monkeypatch.setattr(weight_files, "FOLDER", tmp_path)
    with pytest.raises(UserError, match="no weights 'modelnet40' in .*there: none yet"):
        LatentCem().prepare()


def test_the_equivariant_model_without_weights_is_another_one():
    problem, _ = clouds.permuted_problem()
    noisy = clouds.make_problem(problem.source, problem.target + np.random.default_rng(0).normal(0, 0.01, (1, 3)))
    answers = [LatentCem(model="equivariant", weights=name).register(noisy) for name in ("default", "none")]
    assert not np.array_equal(answers[0].T_target_source, answers[1].T_target_source)


def test_the_papers_model_has_no_closed_form():
    with pytest.raises(UserError, match="start=closed_form needs model=equivariant"):
        LatentCem(start="closed_form").prepare()


@pytest.mark.usefixtures("weights")
@pytest.mark.parametrize("refine", ["none", "icp", "verify"])
def test_weights_of_the_package_are_used(refine):
    problem, _ = clouds.easy_problem(100)
    method = LatentCem(refine=refine, T=2, N=50, K=5)
    first, second = method.register(problem), LatentCem(refine=refine, T=2, N=50, K=5).register(problem)
    assert np.array_equal(first.T_target_source, second.T_target_source)
    assert list(first.stages_s) == ["encode", "plan", "refine"]


def test_a_card_of_another_kind_is_named(weights):
    card = json.loads(card_path(weights).read_text())
    card_path(weights).write_text(json.dumps({**card, "configuration": {"layers": 3}}))
    with pytest.raises(UserError, match=r"modelnet40\.safetensors: the model card's 'configuration' is not"):
        LatentCem().prepare()


def test_reading_the_module_loads_no_torch():
    code = "import sys, regbench_latentcem.registrar; print('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
