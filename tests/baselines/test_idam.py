"""IDAM: layers against naive forms, direction, agreement with a plain rendering, training, conformance."""

from pathlib import Path

import numpy as np
import pytest
import torch
from regbench_baselines.idam.features import GraphLayer, PointFeatures, invariants
from regbench_baselines.idam.losses import balanced_sample
from regbench_baselines.idam.network import IdamNetwork
from regbench_baselines.idam.registrar import Idam
from regbench_baselines.idam.similarity import Points, SimilarityConvolution
from regbench_baselines.idam.training import IdamTraining
from scipy.spatial.transform import Rotation
from torch.nn import functional

from regbench.contract import Problem
from regbench.errors import UserError
from regbench.geometry.se3 import se3, transform, why_not_rigid
from regbench.learning.training.check_trainable import check_trainable
from regbench.learning.training.seeds import sample_generator
from regbench.learning.weights import save_weights
from regbench.metrics.rotation import rotation_error_deg
from regbench.registry import import_file
from regbench.testing import check_registrar
from regbench.testing.check_result import Outcome
from regbench.testing.clouds import body

plain_idam = import_file(Path(__file__).parents[2] / "benchmarks" / "plain" / "idam.py")

SMALL = {"points": 96, "validated_points": 96, "validated": 2, "held_out": 9800}


def network(seed=0, **configuration):
    torch.manual_seed(seed)
    return IdamNetwork(**configuration).eval().requires_grad_(False)


def cloud(count, seed=0):
    return torch.from_numpy(body(count, seed=seed)).float()[None]


def turned(points, rotvec):
    return points @ torch.from_numpy(Rotation.from_rotvec(rotvec).as_matrix()).float().T


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """Weights that match points by their radius and nothing else, which is enough for a cloud and its copy."""
    ours = network(geometry="invariant")
    path = tmp_path_factory.mktemp("idam") / "untrained.safetensors"
    save_weights(path, ours.state_dict(), {"configuration": {"geometry": "invariant"}})
    return str(path)


def test_a_graph_layer_is_the_convolution_of_edges_and_a_maximum():
    torch.manual_seed(1)
    layer = GraphLayer(5, 8)
    features, neighbours = torch.randn(2, 20, 5), torch.randint(20, (2, 20, 4))
    near = torch.stack([each[index] for each, index in zip(features, neighbours, strict=True)])
    centre = features[:, :, None].expand(-1, -1, 4, -1)
    highest = layer.edge(torch.cat([near - centre, centre], dim=3)).amax(dim=2)
    expected = functional.leaky_relu(layer.point(functional.leaky_relu(layer.norm(highest), 0.2)), 0.2)
    torch.testing.assert_close(layer(features, neighbours), expected, atol=1e-5, rtol=1e-5)


def test_invariants_do_not_change_with_a_rotation_nor_with_the_order():
    points = cloud(100)
    features = PointFeatures(geometry="invariant", width=16, layers=2, k=8).requires_grad_(False)
    order = torch.randperm(100)
    torch.testing.assert_close(
        features(turned(points, [1.0, 2.0, -0.5]))[:, order], features(points[:, order]), atol=1e-4, rtol=1e-4
    )


def test_invariants_of_a_cloud_with_fewer_points_than_neighbours_repeat_the_farthest():
    points = torch.tensor([[[1.0, 0, 0], [-1.0, 0, 0]]])
    found = invariants(points, torch.tensor([[[0, 1], [0, 1]]]), 4)
    torch.testing.assert_close(found[0, 0], torch.tensor([1.0, 1, 1, 1, 0, 0, 0, 0]))


def test_the_similarity_convolution_is_that_of_all_pairs_channels():
    torch.manual_seed(2)
    convolution = SimilarityConvolution(features=6, width=8, compared=True).requires_grad_(False)
    source, target = (Points(torch.randn(2, n, 3), torch.randn(2, n, 6)) for n in (7, 9))
    offsets = source.xyz[:, :, None] - target.xyz[:, None]
    distances = offsets.norm(dim=3, keepdim=True)
    pairs = torch.cat(
        [
            source.features[:, :, None].expand(-1, -1, 9, -1),
            target.features[:, None].expand(-1, 7, -1, -1),
            distances,
            offsets / distances,
            (source.features[:, :, None] - target.features[:, None]).square().mean(dim=3, keepdim=True),
        ],
        dim=3,
    )
    pairs = convolution.hidden(convolution.pair(pairs).relu()).relu()
    scores, validity = convolution(source, target)
    torch.testing.assert_close(scores, convolution.score(pairs)[..., 0], atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(validity, convolution.validity(pairs.amax(dim=2))[..., 0], atol=1e-5, rtol=1e-5)


def test_matching_in_blocks_is_matching_at_once():
    convolution = SimilarityConvolution(features=6, width=8, compared=True).requires_grad_(False)
    source, target = (Points(torch.randn(2, n, 3), torch.randn(2, n, 6)) for n in (300, 500))
    scores, validity = convolution(source, target)
    best, valid = convolution.match(source, target)
    assert torch.equal(best, scores.argmax(dim=2))
    torch.testing.assert_close(valid, validity.sigmoid())


@pytest.mark.parametrize(("geometry", "compared"), [("xyz", False), ("invariant", True), ("both", True)])
def test_it_answers_what_a_plain_rendering_answers(geometry, compared):
    configuration = {"geometry": geometry, "compared": compared}
    ours = network(3, **configuration)
    plain = plain_idam.from_ours(ours.state_dict(), configuration).eval().requires_grad_(False)
    source, target = cloud(500), turned(cloud(450, seed=1), [0.1, 0.3, 0.2])
    for shares in ({}, {"source_share": 0.5, "target_share": 0.3}):
        T = ours.align(source, target, **shares).T_target_source
        torch.testing.assert_close(T, plain.align(source, target, **shares), atol=1e-4, rtol=0)


def test_sampled_points_are_half_with_partners_which_are_the_nearest():
    torch.manual_seed(4)
    T = torch.from_numpy(se3(Rotation.from_rotvec([0, 0, 0.5]).as_matrix(), [0.1, 0, 0])).float()[None]
    source = cloud(120)
    target = (source @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3])[:, torch.randperm(120)[:60]]
    sampled = balanced_sample(source, target, T, 0.5, 0.6, 1e-3)
    assert sampled.source.shape == (1, 60)
    assert sampled.target.shape == (1, 36)
    assert len(sampled.source.unique()) == 60
    assert sampled.positive[:, :30].all()
    belongs = (source @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3])[0, sampled.source[0]]
    nearest = torch.cdist(belongs, target[0, sampled.target[0]]).min(dim=1)
    assert torch.equal(nearest.indices[sampled.positive[0]], sampled.partner[0][sampled.positive[0]])
    assert torch.equal(nearest.values < 1e-3, sampled.positive[0])


def test_the_order_of_points_does_not_matter(weights):
    problem = Problem(source=body(300), target=body(300, seed=1) @ Rotation.from_rotvec([0, 0.1, 0.2]).as_matrix().T)
    shuffled = Problem(source=np.random.default_rng(1).permutation(problem.source), target=problem.target[::-1])
    first, second = (Idam(weights=weights).register(p).T_target_source for p in (problem, shuffled))
    np.testing.assert_allclose(first, second, atol=1e-4)


def test_clouds_that_determine_nothing_get_a_finite_motion(weights):
    line = np.linspace(0, 1, 30)[:, None] * [1.0, 2.0, 3.0]
    for source in (body(3), line, np.ones((20, 3)), body(1)):
        for target in (source, body(50)):
            T = Idam(weights=weights).register(Problem(source=source, target=target)).T_target_source
            assert why_not_rigid(T, 1e-6) is None


def test_default_weights_are_modelnet40s():
    assert Idam().data_files()[0].name == "modelnet40.safetensors"
    with pytest.raises(UserError, match="no weights 'moon'"):
        Idam(weights="moon").prepare()


def test_it_conforms_in_all_but_its_answers(weights):
    results = check_registrar(Idam, {"weights": weights})
    assert [result.name for result in results if result.outcome is Outcome.FAILED] in ([], ["accuracy"])


@pytest.mark.parametrize("kinds", [["clean", "noise"], ["partial"]])
def test_it_is_trainable(kinds, prepared_data):
    assert check_trainable(IdamTraining({**SMALL, "kinds": kinds}, data=prepared_data)) == []


@pytest.fixture(scope="module")
def learned(prepared_data, tmp_path_factory):
    """Four pairs, and a network that was trained on them alone."""
    trainable = IdamTraining(
        {**SMALL, "kinds": ["clean"], "geometry": "both", "compared": True, "significance_weight": 0.1},
        data=prepared_data,
    )
    samples = [trainable.sample(sample_generator(0, 0, index), 0.0) for index in range(4)]
    batch = {key: torch.from_numpy(np.stack([sample[key] for sample in samples])) for key in samples[0]}
    torch.manual_seed(0)
    trained = trainable.network()
    optimiser = torch.optim.Adam(trained.parameters(), lr=3e-3)
    slower = torch.optim.lr_scheduler.LinearLR(optimiser, 1.0, 0.01, 250)
    for _ in range(250):
        optimiser.zero_grad()
        sum(trainable.losses(trained, batch, 0.0).values()).backward()
        optimiser.step()
        slower.step()
    path = tmp_path_factory.mktemp("idam") / "learned.safetensors"
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
    answer = Idam(weights=path).register(Problem(source=source, target=target))
    truth = transform(pair["T_target_source"], pair["source"]) * 7.0
    np.testing.assert_allclose(transform(answer.T_target_source, source), truth, atol=0.2)
    assert answer.iterations == 10
    assert 0.5 < answer.confidence <= 1
