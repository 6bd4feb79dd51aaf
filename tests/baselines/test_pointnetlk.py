"""PointNetLK and FMR: direction, agreement with a plain rendering, training, and the method's contract."""

from pathlib import Path

import numpy as np
import pytest
import torch
from regbench_baselines.fmr.registrar import Fmr
from regbench_baselines.fmr.training import FmrTraining
from regbench_baselines.pointnetlk.network import PointNetLkNetwork
from regbench_baselines.pointnetlk.registrar import PointNetLk
from regbench_baselines.pointnetlk.training import PointNetLkTraining
from scipy.spatial.transform import Rotation

from regbench.contract import Problem
from regbench.geometry.se3 import se3, transform
from regbench.learning.training.check_trainable import check_trainable
from regbench.learning.training.seeds import sample_generator
from regbench.learning.weights import load_weights, save_weights
from regbench.metrics.rotation import rotation_error_deg
from regbench.protocols.draws import DCP_PRIOR
from regbench.registry import import_file
from regbench.testing import assert_conforms
from regbench.testing.clouds import body

plain_pointnetlk = import_file(Path(__file__).parents[2] / "benchmarks" / "plain" / "pointnetlk.py")

SMALL = {"points": 64, "validated_points": 64, "validated": 2, "held_out": 9800, "widths": [16, 32], "iterations": 2}
CLASSES = {"pointnetlk": (PointNetLk, PointNetLkTraining), "fmr": (Fmr, FmrTraining)}


@pytest.fixture(params=CLASSES)
def name(request):
    return request.param


@pytest.fixture
def untrained(tmp_path):
    """Weights of a random network, which align clean clouds well enough."""
    torch.manual_seed(0)
    network = PointNetLkNetwork(widths=[64, 64, 512], normalisation="none")
    path = tmp_path / "untrained.safetensors"
    save_weights(path, network.state_dict(), {"configuration": {"widths": [64, 64, 512], "normalisation": "none"}})
    return str(path)


def test_the_motion_is_from_source_to_target(name, untrained):
    truth = se3(Rotation.from_rotvec([0.2, 0.1, -0.15]).as_matrix(), [5.0, -3.0, 2.0])
    source = 7.0 * body(400)
    problem = Problem(source=source, target=np.random.default_rng(0).permutation(transform(truth, source)))
    answer = CLASSES[name][0](weights=untrained).register(problem)
    np.testing.assert_allclose(answer.T_target_source, truth, atol=1e-2)
    assert answer.iterations > 1
    assert answer.confidence > -1e-3


def test_it_conforms(untrained):
    assert_conforms(PointNetLk, {"weights": untrained})


@pytest.mark.parametrize("normalisation", ["batch", "none"])
def test_it_answers_what_a_plain_rendering_answers(normalisation):
    torch.manual_seed(0)
    configuration = {"widths": [64, 128, 256], "normalisation": normalisation}
    network = PointNetLkNetwork(**configuration)
    for norm in network.encoder.norms:
        torch.nn.init.uniform_(norm.weight, 0.5, 1.5)
        torch.nn.init.normal_(norm.running_mean, 0, 0.1)
    network.eval().requires_grad_(False)
    plain = plain_pointnetlk.from_ours(network.state_dict(), configuration).eval().requires_grad_(False)
    source = torch.from_numpy(body(200)).float()[None]
    turned = source @ torch.from_numpy(Rotation.from_rotvec([0.1, 0.0, 0.2]).as_matrix()).float().T
    torch.testing.assert_close(network.encoder(source), plain(source), atol=1e-5, rtol=1e-4)
    options = {"iterations": 5, "jacobian": "numerical", "descent": False, "from_mean": False}
    ours = network.align(source, turned, **options).T_target_source
    torch.testing.assert_close(ours, plain.align(source, turned, iterations=5), atol=1e-4, rtol=0)


def test_the_order_of_points_does_not_matter(untrained):
    problem = Problem(source=body(300), target=body(300) @ Rotation.from_rotvec([0, 0.1, 0.2]).as_matrix().T)
    shuffled = Problem(source=np.random.default_rng(1).permutation(problem.source), target=problem.target[::-1])
    first, second = (PointNetLk(weights=untrained).register(p).T_target_source for p in (problem, shuffled))
    np.testing.assert_allclose(first, second, atol=1e-4)


@pytest.mark.parametrize("normalisation", ["batch", "none"])
def test_they_are_trainable(name, normalisation, prepared_data):
    assert check_trainable(CLASSES[name][1]({**SMALL, "normalisation": normalisation}, data=prepared_data)) == []


def test_fmr_is_unsupervised_unless_the_pose_counts(prepared_data):
    for weight, words in ((0.0, "unsupervised"), (1.0, "supervised")):
        trainable = FmrTraining({**SMALL, "pose_weight": weight, "normalisation": "none"}, data=prepared_data)
        assert trainable.card()["supervision"] == words
        sample = trainable.sample(sample_generator(0, 0, 0), 0.0)
        batch = {key: torch.from_numpy(value)[None] for key, value in sample.items()}
        torch.manual_seed(0)
        network = trainable.network()
        losses = [
            sum(trainable.losses(network, {**batch, "T_target_source": T[None]}, 0.0).values())
            for T in (torch.eye(4), torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0])))
        ]
        assert torch.equal(*losses) == (weight == 0.0)


def test_fmrs_weight_file_has_no_decoder_and_loads_into_both(tmp_path, prepared_data):
    trainable = FmrTraining({**SMALL, "decoded_points": 64}, data=prepared_data)
    network = trainable.network()
    path = tmp_path / "fmr.safetensors"
    save_weights(path, trainable.tensors(network), trainable.card())
    assert not any(key.startswith("decoder") for key in load_weights(path).tensors)
    assert Fmr(weights=str(path)).register(Problem(source=body(50), target=body(50))).T_target_source.shape == (4, 4)
    again = trainable.network()
    trainable.load(again, load_weights(path))
    cloud = torch.randn(1, 30, 3)
    torch.testing.assert_close(again.encoder(cloud), network.encoder(cloud))


def test_a_handful_of_pairs_is_learned_to_under_a_degree(prepared_data):
    settings = {"points": 96, "kinds": ["noise"], "iterations": 5, "each": True}
    network_settings = {"widths": [32, 64, 256], "normalisation": "none"}
    trainable = PointNetLkTraining(settings | network_settings, data=prepared_data)
    samples = [trainable.sample(sample_generator(0, 0, index), 0.0) for index in range(4)]
    batch = {key: torch.from_numpy(np.stack([sample[key] for sample in samples])) for key in samples[0]}
    torch.manual_seed(0)
    network = trainable.network()

    def errors_deg():
        with torch.no_grad():
            answers = network.align(batch["source"], batch["target"], from_mean=False).T_target_source
        return rotation_error_deg(*(T[:, :3, :3].double().numpy() for T in (answers, batch["T_target_source"])))

    before = errors_deg().mean()
    optimiser = torch.optim.Adam(network.parameters(), lr=2e-3)
    for _ in range(300):
        optimiser.zero_grad()
        sum(trainable.losses(network, batch, 0.0).values()).backward()
        optimiser.step()
    assert errors_deg().mean() < 1.0 < before


def test_the_second_start_is_the_benchmarks_mean_rotation(untrained):
    mean = DCP_PRIOR.mean_T_target_source()[:3, :3]
    problem = Problem(source=body(300), target=body(300) @ mean.T)
    one, two = (PointNetLk(weights=untrained, iterations=1, from_mean=both).register(problem) for both in (False, True))
    np.testing.assert_allclose(two.T_target_source[:3, :3], mean, atol=1e-5)
    assert two.confidence > one.confidence
