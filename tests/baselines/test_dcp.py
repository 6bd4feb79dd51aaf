"""DCP-v2: direction, agreement with a plain rendering, training, conformance."""

from pathlib import Path

import numpy as np
import pytest
import torch
from regbench_baselines.dcp.losses import dcp_losses
from regbench_baselines.dcp.network import DcpNetwork, log_matches
from regbench_baselines.dcp.registrar import Dcp
from regbench_baselines.dcp.training import DcpTraining
from scipy.spatial.transform import Rotation

from regbench.contract import Problem
from regbench.geometry.se3 import transform, why_not_rigid
from regbench.learning.training.check_trainable import check_trainable
from regbench.learning.training.seeds import sample_generator
from regbench.learning.weights import save_weights
from regbench.metrics.rotation import rotation_error_deg
from regbench.registry import import_file
from regbench.testing import check_registrar
from regbench.testing.check_result import Outcome
from regbench.testing.clouds import body

plain_dcp = import_file(Path(__file__).parents[2] / "benchmarks" / "plain" / "dcp.py")

SIZE = {"width": 32, "hidden": 64}
SMALL = {"points": 64, "validated_points": 64, "validated": 2, "held_out": 9800, **SIZE}


def network(seed=0):
    torch.manual_seed(seed)
    return DcpNetwork(**SIZE).eval().requires_grad_(False)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    path = tmp_path_factory.mktemp("dcp") / "untrained.safetensors"
    save_weights(path, network().state_dict(), {"configuration": SIZE})
    return str(path)


def test_it_answers_what_a_plain_rendering_answers():
    ours = network(3)
    for norm in [layer.norm for layer in ours.edges] + [ours.norm, ours.encoded, ours.decoded]:
        torch.nn.init.uniform_(norm.weight, 0.5, 1.5)
        torch.nn.init.normal_(norm.bias, 0, 0.1)
    plain = plain_dcp.from_ours(ours.state_dict(), SIZE).eval().requires_grad_(False)
    source, target = (torch.from_numpy(body(count, seed=count)).float()[None] for count in (200, 170))
    torch.testing.assert_close(
        ours.align(source, target).T_target_source, plain.align(source, target), atol=1e-4, rtol=0
    )


def test_matches_are_shares_by_scaled_products():
    torch.manual_seed(0)
    of_source, of_target = torch.randn(2, 5, 16), torch.randn(2, 7, 16)
    expected = (torch.einsum("bic,bjc->bij", of_source, of_target) / 4).softmax(dim=2)
    torch.testing.assert_close(log_matches(of_source, of_target).exp(), expected)


def test_the_loss_is_nothing_for_the_answer_itself():
    ours = network()
    source, target = (torch.from_numpy(body(50, seed=seed)).float()[None] for seed in (0, 1))
    T = ours.align(source, target).T_target_source
    assert dcp_losses(ours, {"source": source, "target": target, "T_target_source": T})["pose"] < 1e-6
    other = torch.eye(4)[None] @ T
    other[:, 0, 3] += 0.5
    pose = dcp_losses(ours, {"source": source, "target": target, "T_target_source": other})["pose"]
    assert pose.item() == pytest.approx(0.25, rel=1e-3)


def test_the_order_of_points_does_not_matter(weights):
    problem = Problem(source=body(300), target=body(250, seed=1) @ Rotation.from_rotvec([0, 0.1, 0.2]).as_matrix().T)
    shuffled = Problem(source=np.random.default_rng(1).permutation(problem.source), target=problem.target[::-1])
    first, second = (Dcp(weights=weights).register(p).T_target_source for p in (problem, shuffled))
    np.testing.assert_allclose(first, second, atol=1e-4)


def test_clouds_that_determine_nothing_get_a_finite_motion(weights):
    line = np.linspace(0, 1, 30)[:, None] * [1.0, 2.0, 3.0]
    for source in (body(3), line, np.ones((20, 3)), body(1)):
        for target in (source, body(50)):
            T = Dcp(weights=weights).register(Problem(source=source, target=target)).T_target_source
            assert why_not_rigid(T, 1e-6) is None


def test_it_conforms_in_all_but_its_answers(weights):
    results = check_registrar(Dcp, {"weights": weights})
    assert [result.name for result in results if result.outcome is Outcome.FAILED] in ([], ["accuracy"])


@pytest.mark.parametrize("matching_weight", [0.0, 1.0])
def test_it_is_trainable(matching_weight, prepared_data):
    trainable = DcpTraining({**SMALL, "matching_weight": matching_weight}, data=prepared_data)
    assert check_trainable(trainable) == []


@pytest.fixture(scope="module")
def learned(prepared_data, tmp_path_factory):
    """Four pairs, and a network that was trained on them alone."""
    trainable = DcpTraining({**SMALL, "kinds": ["clean"], "matching_weight": 1.0}, data=prepared_data)
    samples = [trainable.sample(sample_generator(0, 0, index), 0.0) for index in range(4)]
    batch = {key: torch.from_numpy(np.stack([sample[key] for sample in samples])) for key in samples[0]}
    torch.manual_seed(0)
    trained = trainable.network()
    optimiser = torch.optim.Adam(trained.parameters(), lr=2e-3)
    for _ in range(100):
        optimiser.zero_grad()
        sum(trainable.losses(trained, batch, 0.0).values()).backward()
        optimiser.step()
    path = tmp_path_factory.mktemp("dcp") / "learned.safetensors"
    save_weights(path, trained.state_dict(), trainable.card())
    return batch, trained.eval().requires_grad_(False), str(path)


def test_a_handful_of_pairs_is_learned_to_under_a_degree(learned):
    batch, trained, _ = learned
    answers = trained.align(batch["source"], batch["target"]).T_target_source
    errors = rotation_error_deg(*(T[:, :3, :3].double().numpy() for T in (answers, batch["T_target_source"])))
    assert errors.max() < 1.0


def test_the_motion_is_from_source_to_target_in_the_users_units(learned):
    batch, _, path = learned
    place = np.array([30.0, -20.0, 5.0])
    pair = {name: batch[name][0].double().numpy() for name in ("source", "target", "T_target_source")}
    source, target = 7.0 * pair["source"] + place, 7.0 * pair["target"]
    answer = Dcp(weights=path).register(Problem(source=source, target=target))
    truth = transform(pair["T_target_source"], pair["source"]) * 7.0
    np.testing.assert_allclose(transform(answer.T_target_source, source), truth, atol=0.3)
