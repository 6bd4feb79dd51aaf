import itertools

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from regbench.geometry.se3 import transform
from regbench_latentcem.actions import motion_of
from regbench_latentcem.losses import (
    LIKED,
    distances_after,
    evaluation_loss,
    reconstruction_loss,
    relative_transformation_loss,
    training_losses,
    transformation_loss,
)
from regbench_latentcem.model import Configuration, LatentModel
from regbench_latentcem.sampling import Sampling, draw_sample


def chamfer(x, y):
    return cKDTree(y).query(x)[0].mean() + cKDTree(x).query(y)[0].mean()


@pytest.fixture(scope="module")
def case():
    torch.manual_seed(0)
    model = LatentModel(Configuration(transformation_widths=(64, 32), evaluation_widths=(32, 32)))
    cloud = np.random.default_rng(0).normal(0, 0.4, (60, 3))
    sampling = Sampling(copies=3, targets=2, near=2, proposed=20)
    samples = [draw_sample(cloud, 50, sampling, np.random.default_rng(seed)) for seed in (1, 2)]
    return model, {name: torch.from_numpy(np.stack([sample[name] for sample in samples])) for name in samples[0]}


def test_terms_by_hand():
    assert transformation_loss(torch.tensor([[1.0, 2], [0, 0]]), torch.zeros(2, 2)).item() == 2.5  # (1 + 4 + 0) / 2
    assert evaluation_loss(torch.tensor([1.0, 2]), torch.tensor([0.0, 5])).item() == 5  # (1 + 9) / 2
    points = torch.tensor([[[0.0, 0, 0]], [[0, 0, 0]]])
    assert reconstruction_loss(points + torch.tensor([3.0, 4, 0]), points).item() == 10  # 5 each way


def test_the_relative_transformation_loss_is_the_unexplained_share_of_the_variance():
    states = torch.randn(5, 3, 512, generator=torch.Generator().manual_seed(0)) * 2 + 7
    mean = states.flatten(0, 1).mean(dim=0).expand_as(states)
    assert relative_transformation_loss(mean, states).item() == pytest.approx(1, rel=1e-5)
    assert relative_transformation_loss(states, states).item() == 0
    assert relative_transformation_loss(3 * mean, 3 * states).item() == pytest.approx(1, rel=1e-5)


def test_every_term_is_its_equation(case):
    """Recomputed sample by sample from the networks' answers, distances by SciPy, moved clouds by regbench.geometry."""
    model, batch = case
    with torch.no_grad():
        torch.manual_seed(3)
        terms = training_losses(model, batch, decoded=8)  # every cloud
        rec, evaluation, residuals, moved_states, prediction = [], [], [], [], []
        for b in range(2):
            source, copies, actions = (batch[name][b] for name in ("source", "copies", "actions"))
            clouds = [source, *copies]
            states = [model.encode(cloud[None]) for cloud in clouds]
            for i, j in itertools.permutations(range(4), 2):
                true = chamfer(clouds[i].numpy(), clouds[j].numpy())
                evaluation.append((model.evaluation(states[i], states[j]).item() - true) ** 2)
            rec += [chamfer(model.decoder(z)[0].numpy(), c.numpy()) for z, c in zip(states, clouds, strict=True)]
            for action, state in zip(actions, states[1:], strict=True):
                residuals.append((model.transformation(states[0], action[None]) - state).square().sum().item())
                moved_states.append(state)
            for target in range(2):
                proposed = batch["proposed"][b, target]
                liked = model.reward(states[0], states[1 + target])(proposed[None])[0].topk(LIKED).indices
                for action in [*batch["near"][b, target], *proposed[liked], *proposed[:LIKED]]:
                    moved = transform(motion_of(action), source)
                    d = model.evaluation(model.transformation(states[0], action[None]), states[1 + target])
                    prediction.append((d.item() - chamfer(moved, clouds[1 + target].numpy())) ** 2)
        variance = torch.cat(moved_states).var(dim=0, correction=0).sum().item()
    assert terms["reconstruction"].item() == pytest.approx(np.mean(rec), rel=1e-4)
    assert terms["transformation"].item() == pytest.approx(np.mean(residuals) / variance, rel=1e-4)
    assert terms["evaluation"].item() == pytest.approx(np.mean(evaluation), rel=1e-3)
    assert terms["prediction"].item() == pytest.approx(np.mean(prediction), rel=1e-3)


def test_with_given_states_no_gradient_reaches_the_encoder_nor_f_from_d(case):
    model, batch = case
    states = torch.randn(2, 4, 512)
    model.zero_grad()
    terms = training_losses(model, batch, decoded=0, states=states)
    assert "reconstruction" not in terms
    (terms["evaluation"] + terms["prediction"]).backward()
    assert {name.split(".")[0] for name, p in model.named_parameters() if p.grad is not None} == {"evaluation"}
    terms["transformation"].backward()
    assert model.encoder.last.weight.grad is None


def test_distances_from_some_points_are_right_on_average():
    rng = np.random.default_rng(0)
    source, target = rng.normal(size=(1, 200, 3)), rng.normal(size=(1, 1, 150, 3))
    action = rng.normal(size=(1, 1, 1, 6))
    true = chamfer(transform(motion_of(action[0, 0, 0]), source[0]), target[0, 0])
    clouds = [torch.from_numpy(values) for values in (source, target, action)]
    assert distances_after(*clouds, queries=200).item() == pytest.approx(true, rel=1e-6)
    torch.manual_seed(0)
    some = [distances_after(*clouds, queries=20).item() for _ in range(400)]
    assert np.mean(some) == pytest.approx(true, abs=4 * np.std(some) / 20)


def test_every_parameter_gets_a_gradient(case):
    model, batch = case
    model.zero_grad()
    sum(training_losses(model, batch, decoded=2).values()).backward()
    assert [name for name, p in model.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0] == []


def test_a_few_steps_lower_the_loss(case):
    torch.manual_seed(0)
    model = LatentModel(Configuration(decoder="mlp", transformation_widths=(64, 32), evaluation_widths=(32, 32)))
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-3)
    values = []
    for _ in range(20):
        optimiser.zero_grad()
        loss = sum(training_losses(model, case[1], decoded=8).values())
        loss.backward()
        optimiser.step()
        values.append(loss.item())
    assert values[-1] < 0.5 * values[0]
