"""What every learned method of two clouds gets from the base: weights, frame, start."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from regbench.contract import MotionPrior, Problem
from regbench.errors import UserError
from regbench.geometry.se3 import se3, why_not_rigid
from regbench.learning.pair_network import Alignment
from regbench.learning.weights import save_weights
from regbench.testing.check_registrar import check_registrar
from regbench.testing.check_result import Outcome
from regbench.testing.clouds import body
from tests.learning.toy_pair import ToyNetwork, ToyPair


@pytest.fixture
def weights(tmp_path):
    torch.manual_seed(0)
    path = tmp_path / "toy.safetensors"
    save_weights(path, ToyNetwork(width=6).state_dict(), {"configuration": {"width": 6}})
    return str(path)


class Told(ToyPair):
    """Answers a given rotation and keeps the clouds it was given."""

    def prepare(self):
        self._network = self

    def to(self, device):
        return self

    def align(self, source, target, **options):
        self.seen = source[0].double().numpy(), target[0].double().numpy()
        T = torch.eye(4)[None].repeat(1, 1, 1)
        T[0, :3, :3] = torch.from_numpy(self.rotation)
        return Alignment(T)


def told(rotation, **parameters):
    method = Told(**parameters)
    method.rotation = rotation
    return method


def test_a_registrar_of_few_lines_conforms_in_all_but_its_answers(weights):
    results = check_registrar(ToyPair, {"weights": weights})
    assert [result.name for result in results if result.outcome is Outcome.FAILED] == ["accuracy"]


def test_the_network_sees_clouds_about_their_centroids_in_extents_and_its_answer_is_put_back():
    rotation = Rotation.from_rotvec([0.2, -0.5, 0.3]).as_matrix()
    source = 50 * body(200) + [100.0, -30.0, 7.0]
    target = source @ rotation.T + [3.0, 2.0, 1.0]
    method = told(rotation)
    answer = method.register(Problem(source=source, target=target))
    np.testing.assert_allclose(answer.T_target_source, se3(rotation, [3.0, 2.0, 1.0]), atol=1e-4)
    assert why_not_rigid(answer.T_target_source, 1e-12) is None
    for cloud in method.seen:
        np.testing.assert_allclose(cloud.mean(axis=0), 0, atol=1e-6)
        assert np.linalg.norm(cloud, axis=1).max() == pytest.approx(1, rel=1e-5)


def test_the_start_moves_the_source_first():
    prior = MotionPrior((0.0,) * 3, (45.0,) * 3, (0.0,) * 3, (0.0,) * 3)
    mean = prior.mean_T_target_source()[:3, :3]
    cloud = body(100)
    problem = Problem(source=cloud, target=cloud @ mean.T, motion_prior=prior)
    method = told(np.eye(3), init="prior")
    np.testing.assert_allclose(method.register(problem).T_target_source[:3, :3], mean, atol=1e-6)
    np.testing.assert_allclose(*method.seen, atol=1e-6)
    bare = Problem(source=cloud, target=cloud)
    assert "motion prior" in method.skip(bare)
    given = Problem(source=cloud, target=cloud @ mean.T, init_T_target_source=se3(mean, np.zeros(3)))
    np.testing.assert_allclose(told(np.eye(3)).register(given).T_target_source[:3, :3], mean, atol=1e-6)


def test_large_clouds_are_drawn_from(weights):
    method = told(np.eye(3), max_points=128)
    method.register(Problem(source=body(1000), target=body(100)))
    assert [len(cloud) for cloud in method.seen] == [128, 100]


def test_weights_that_are_not_there_or_of_another_model_are_named(tmp_path):
    with pytest.raises(UserError, match="no weights 'default' in nowhere"):
        ToyPair().prepare()
    other = tmp_path / "other.safetensors"
    save_weights(other, ToyNetwork().state_dict(), {"configuration": {"depth": 3}})
    with pytest.raises(UserError, match="'configuration' is not toy_pair's.*depth"):
        ToyPair(weights=str(other)).prepare()
    save_weights(other, ToyNetwork().state_dict(), {"configuration": {"width": 5}})
    with pytest.raises(UserError, match="made for another model"):
        ToyPair(weights=str(other)).prepare()


def test_listing_it_loads_no_torch():
    code = "import sys, regbench.learning.pair_registrar; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
