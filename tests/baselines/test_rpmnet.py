"""RPM-Net: its layers against plain forms, what its answers must not depend on, and that it learns."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from regbench_baselines.rpmnet.local_geometry import LocalGeometry, point_pair_features
from regbench_baselines.rpmnet.losses import training_losses
from regbench_baselines.rpmnet.network import RpmNet, Step
from regbench_baselines.rpmnet.perceptron_max import perceptron_max
from regbench_baselines.rpmnet.registrar import RpmNetRegistrar
from regbench_baselines.rpmnet.soft_matches import soft_matches
from regbench_baselines.rpmnet.training import RpmNetTraining
from scipy.spatial.transform import Rotation
from torch.utils.data import default_collate

from regbench.contract import Problem
from regbench.geometry.se3 import se3, transform
from regbench.learning.layers.sinkhorn import log_sinkhorn
from regbench.learning.training.check_trainable import check_trainable
from regbench.learning.training.seeds import sample_generator
from regbench.learning.weights import save_weights
from regbench.metrics.rotation import rotation_error_deg
from regbench.registry import import_file
from regbench.testing.check_registrar import check_registrar
from regbench.testing.check_result import Outcome
from regbench.testing.clouds import body

PlainRpmNet = import_file(Path(__file__).parents[2] / "benchmarks" / "plain" / "rpmnet.py").PlainRpmNet
MOTION = se3(Rotation.from_euler("xyz", [30, 10, 40], degrees=True).as_matrix(), [0.05, -0.02, 0.03])


def network(**configuration):
    torch.manual_seed(0)
    return RpmNet(**configuration).eval()


def pair(source=90, target=70, clouds=2):
    made = [[body(count, seed + 9 * which) for seed in range(clouds)] for which, count in enumerate((source, target))]
    return [torch.tensor(np.stack(each), dtype=torch.float32) for each in made]


def answer(net, source, target, iterations=3):
    with torch.inference_mode():
        return net.align(source, target, iterations=iterations).T_target_source


def test_it_answers_what_the_plain_rendering_of_the_paper_answers():
    net, plain = network(neighbours=12), PlainRpmNet(neighbours=12)
    plain.load_ours(net.state_dict())
    source, target = pair()
    with torch.no_grad():
        expected = plain(source, target, iterations=3)
    torch.testing.assert_close(answer(net, source, target), expected, atol=1e-4, rtol=0)


def test_the_layers_on_neighbours_and_their_gradients_are_the_plain_ones():
    generator = torch.Generator().manual_seed(0)

    def draw(*shape):
        return torch.randn(shape, generator=generator)

    rows, out = draw(2, 70, 12, 10), draw(2, 70, 40)  # more rows than one piece has
    sizes = ((24, 10), (24, 24), (40, 24))
    parameters = [draw(*size).requires_grad_() for size in sizes] + [draw(size[0]).requires_grad_() for size in sizes]
    found = perceptron_max(rows, parameters[:3], parameters[3:])
    hidden = rows
    for weight, bias in zip(parameters[:2], parameters[3:5], strict=True):
        hidden = (hidden @ weight.T + bias).relu()
    plain = (hidden @ parameters[2].T + parameters[5]).amax(dim=2)
    torch.testing.assert_close(found, plain, rtol=1e-4, atol=1e-4)
    with torch.no_grad():
        torch.testing.assert_close(perceptron_max(rows, parameters[:3], parameters[3:]), plain, rtol=1e-4, atol=1e-4)
    gradients = (torch.autograd.grad(value, parameters, out) for value in (found, plain))
    for ours, theirs in zip(*gradients, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=1e-3 * theirs.abs().max().item())


def test_soft_matches_are_sinkhorns_and_so_are_their_gradients():
    generator = torch.Generator().manual_seed(0)
    source, target, offset, points = (
        torch.randn(shape, generator=generator, dtype=torch.float64).requires_grad_()
        for shape in ((2, 6, 4), (2, 5, 4), (2,), (2, 5, 3))
    )
    points = points.detach()
    P = log_sinkhorn(source @ target.transpose(1, 2) + offset[:, None, None], 5).exp()
    found = soft_matches(source, target, offset, points)
    for ours, theirs in zip(found, (P @ points, P.sum(dim=2), P.sum(dim=1)), strict=True):
        torch.testing.assert_close(ours, theirs)
    assert torch.autograd.gradcheck(lambda *tensors: soft_matches(*tensors, points), (source, target, offset))


def test_point_pair_features_are_angles_of_lines_and_a_distance():
    x, y = torch.tensor([1.0, 0.0, 0.0]), torch.tensor([0.0, 1.0, 0.0])
    found = point_pair_features(2 * (x + y), -x, y)
    torch.testing.assert_close(found, torch.tensor([torch.pi / 4, torch.pi / 4, torch.pi / 2, 8**0.5]))
    torch.testing.assert_close(point_pair_features(0 * x, x, x), torch.zeros(4))


def test_a_motion_turns_the_offsets_and_nothing_else():
    cloud = body(120)
    found = [
        LocalGeometry.of(torch.tensor(points)[None], radius=0.4, neighbours=8, normal_neighbours=10)
        for points in (cloud, transform(MOTION, cloud))
    ]
    rows = found[0].rows(torch.tensor(MOTION)[None])
    # In no order: sorted by distance.
    ours, theirs = (torch.take_along_dim(each, each[..., 9:].argsort(dim=2), dim=2) for each in (rows, found[1].rows()))
    torch.testing.assert_close(ours, theirs, atol=1e-6, rtol=0)


def test_losses_are_the_papers():
    T = torch.eye(4)[None]
    moved = T.clone()
    moved[:, 0, 3] = 0.3
    shares = torch.full((1, 4), 0.75)
    steps = [Step(moved, shares, shares), Step(T, shares, shares)]
    found = training_losses(steps, torch.zeros(1, 4, 3), T, 0.01)
    assert found["registration"].item() == pytest.approx(0.5 * 0.1)
    assert found["inliers"].item() == pytest.approx(0.01 * 1.5 * 0.5)


def test_the_order_of_points_does_not_matter():
    net = network()
    source, target = pair()
    found = answer(net, source, target)
    permuted = answer(net, source.flip(1), target.roll(17, dims=1))
    torch.testing.assert_close(found, permuted, atol=1e-4, rtol=0)
    torch.testing.assert_close(found, answer(net, source, target), atol=0, rtol=0)


@pytest.mark.parametrize("shape", ["three points", "a line", "one point", "ten against a thousand"])
def test_degenerate_clouds_give_a_finite_motion(shape):
    cloud = {
        "three points": torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        "a line": torch.linspace(-1, 1, 50)[:, None].expand(50, 3),
        "one point": torch.zeros(20, 3),
        "ten against a thousand": torch.tensor(body(10), dtype=torch.float32),
    }[shape][None]
    other = torch.tensor(body(1000), dtype=torch.float32)[None] if shape.startswith("ten") else cloud
    for source, target in ((cloud, other), (other, cloud)):
        assert answer(network(), source, target).isfinite().all()


SETTINGS = {"points": 128, "validated_points": 128, "validated": 4, "neighbours": 12}


@pytest.fixture
def training(prepared_data):
    return RpmNetTraining({**SETTINGS, "kinds": ["noise"]}, data=prepared_data)


def test_it_learns_a_few_pairs(training):
    torch.manual_seed(0)
    net = training.network()
    batch = default_collate([training.sample(sample_generator(0, 0, index), 0.0) for index in range(4)])
    optimiser = torch.optim.Adam(net.parameters(), lr=2e-3)
    for _ in range(60):
        optimiser.zero_grad()
        sum(training.losses(net, batch, 0.0).values()).backward()
        optimiser.step()
    found = answer(net.eval(), batch["source"], batch["target"], iterations=5)
    assert rotation_error_deg(found[:, :3, :3].double().numpy(), batch["T_target_source"][:, :3, :3].numpy()).max() < 1


def test_the_trainable_keeps_its_promises(prepared_data):
    trainable = RpmNetTraining({**SETTINGS, "kinds": ["partial"]}, data=prepared_data)
    assert check_trainable(trainable) == []


def test_the_shipped_weights_find_a_known_motion():
    source = body(600)
    target = np.random.default_rng(0).permutation(transform(MOTION, source))
    found = RpmNetRegistrar().register(Problem(source=source, target=target))
    assert rotation_error_deg(found.T_target_source[None, :3, :3], MOTION[None, :3, :3])[0] < 3
    np.testing.assert_allclose(found.T_target_source[:3, 3], MOTION[:3, 3], atol=0.05)
    assert 0 < found.confidence <= 1
    assert found.iterations == 5


def test_it_conforms():
    results = check_registrar(RpmNetRegistrar)
    assert [result for result in results if result.outcome is Outcome.FAILED] == []


def test_any_weights_can_be_given(tmp_path):
    path = tmp_path / "small.safetensors"
    save_weights(path, network(neighbours=8, width=16).state_dict(), {"configuration": {"neighbours": 8, "width": 16}})
    method = RpmNetRegistrar(weights=str(path), iterations=2)
    assert method.register(Problem(source=body(50), target=body(40))).iterations == 2
    assert method.data_files() == [Path(path)]


def test_listing_it_loads_no_torch():
    code = "import sys, regbench_baselines.rpmnet.registrar; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
