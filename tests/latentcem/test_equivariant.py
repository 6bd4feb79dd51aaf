import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from regbench.geometry.kabsch import kabsch
from regbench.testing.clouds import body
from regbench_latentcem import invariants
from regbench_latentcem.actions import move, rotations_of
from regbench_latentcem.equivariant import (
    VectorEncoder,
    VectorState,
    closed_form,
    isotropic,
    latent_distance,
    latent_distance_reward,
)
from regbench_latentcem.invariants import local_invariants
from regbench_latentcem.pair_evaluation import PairEvaluation
from regbench_latentcem.planner import generators_of, plan


def cloud(points=300, seed=0):
    return torch.from_numpy(body(points, seed))[None]


def action(seed=0, count=1):
    return torch.randn(count, 6, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def states(count=2, channels=16):
    draws = torch.randn(2, count, channels + 1, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return [VectorState(each[:, :-1], each[:, -1]) for each in draws]


@pytest.mark.parametrize("points", [1, 2, 5, 60, 300])
@pytest.mark.parametrize("isotropy", [None, 0.1])
def test_the_transformation_network_is_exact(points, isotropy):
    """f(enc(X), a) = enc(X moved by a), for any action in SE(3)."""
    encoder, a = VectorEncoder(channels=32, isotropy=isotropy), action(points)
    source = cloud(points)
    predicted, true = encoder(source).after(a), encoder(move(source, a))
    torch.testing.assert_close(predicted.vectors, true.vectors, rtol=0, atol=1e-8)
    torch.testing.assert_close(predicted.centroid, true.centroid, rtol=0, atol=1e-12)


def test_an_action_in_latent_space_and_on_points_means_the_same_motion():
    """Brute force: of many actions, the one that moves the points onto the target is the one that moves the state."""
    encoder, source, actions = VectorEncoder(channels=64), cloud(), action(3, count=50)
    target = encoder(move(source, actions[17:18]))
    distances = latent_distance(encoder(source).after(actions), target)
    assert distances.argmin() == 17
    assert distances[17] < 1e-15
    assert (distances.sort().values[1:] > 1e-3).all()


def test_the_order_of_the_points_does_not_matter():
    encoder, source = VectorEncoder(), cloud()
    permuted = encoder(source[:, torch.randperm(300, generator=torch.Generator().manual_seed(0))])
    torch.testing.assert_close(permuted.vectors, encoder(source).vectors, rtol=0, atol=1e-9)


def test_a_batch_equals_singles():
    encoder = VectorEncoder()
    clouds = torch.cat([cloud(seed=seed) for seed in range(3)])
    singles = torch.cat([encoder(each[None]).vectors for each in clouds])
    torch.testing.assert_close(encoder(clouds).vectors, singles, rtol=0, atol=1e-9)


def test_the_encoder_is_the_same_for_the_same_seed():
    assert torch.equal(VectorEncoder().weight, VectorEncoder().weight)
    assert not torch.equal(VectorEncoder().weight, VectorEncoder(seed=1).weight)


def test_invariants_by_hand():
    """The 22 numbers, point by point, with NumPy."""
    points = body(200) - body(200).mean(axis=0)
    found = local_invariants(torch.from_numpy(points)[None])[0].numpy()
    for i in (0, 77):
        expected = [np.linalg.norm(points[i])]
        for width in (0.4, 0.2, 0.1):
            weights = np.exp(-np.square(points - points[i]).sum(axis=1) / (2 * width**2))
            mean = weights @ points / weights.sum()
            offset = (mean - points[i]) / width
            spreads = np.sqrt(np.linalg.eigvalsh(np.cov(points.T, aweights=weights, ddof=0))) / width
            lengths = [np.linalg.norm(offset), np.linalg.norm(mean), offset @ points[i]]
            expected += [*lengths, *spreads, 0.3 * np.log(weights.mean())]
        np.testing.assert_allclose(found[i], expected, atol=1e-9)


def test_invariants_do_not_depend_on_the_chunks(monkeypatch):
    points = cloud() - cloud().mean(dim=1, keepdim=True)
    whole = local_invariants(points)
    monkeypatch.setattr(invariants, "CHUNK", 7)
    torch.testing.assert_close(local_invariants(points), whole, rtol=0, atol=1e-12)


def test_mixing_changes_neither_equivariance_nor_what_an_exact_copy_tells():
    encoder, a = VectorEncoder(channels=32), action()
    with torch.no_grad():
        encoder.mixing.copy_(torch.randn(32, 32, generator=torch.Generator().manual_seed(0), dtype=torch.float64))
        source, target = encoder(cloud()), encoder(move(cloud(), a))
        torch.testing.assert_close(source.after(a).vectors, target.vectors, rtol=0, atol=1e-8)
        torch.testing.assert_close(closed_form(source, target)[0], rotations_of(a), rtol=0, atol=1e-8)


def test_isotropic_vectors_reach_equally_far_and_turn_with_their_source():
    vectors = states(channels=50)[0].vectors * torch.tensor([10.0, 1, 0.01])
    even = isotropic(vectors, 0.0)
    torch.testing.assert_close(even.transpose(1, 2) @ even, torch.eye(3).double().expand(2, -1, -1))
    turn = rotations_of(action())[0]
    for floor in (0.0, 0.1):
        turned = isotropic(vectors @ turn.T, floor)
        torch.testing.assert_close(turned, isotropic(vectors, floor) @ turn.T, rtol=0, atol=1e-9)
    assert torch.isfinite(isotropic(torch.zeros(1, 4, 3), 0.1)).all()


def test_the_closed_form_is_kabschs():
    source, target = states(count=3)
    rotations, translations = closed_form(source, target)
    for p in range(3):
        x, y = source.vectors[p].numpy(), target.vectors[p].numpy()
        both_ways = kabsch(np.concatenate([x, -x]), np.concatenate([y, -y]))  # about the origin: no centring
        np.testing.assert_allclose(rotations[p], both_ways[:3, :3], atol=1e-10)
        moved = rotations[p] @ source.centroid[p] + translations[p]
        torch.testing.assert_close(moved, target.centroid[p])


def test_the_closed_form_undoes_any_motion():
    encoder, source = VectorEncoder(), cloud()
    for seed in range(5):
        a = action(seed)
        rotations, translations = closed_form(encoder(source), encoder(move(source, a)))
        torch.testing.assert_close(rotations, rotations_of(a), rtol=0, atol=1e-8)
        torch.testing.assert_close(translations, a[:, 3:], rtol=0, atol=1e-8)


def test_the_planners_reward_is_the_latent_distance():
    source, target = states()
    actions = torch.stack([action(1, 20), action(2, 20)])
    moved = VectorState(source.vectors[:, None], source.centroid[:, None]).after(actions)
    naive = -latent_distance(moved, VectorState(target.vectors[:, None], target.centroid[:, None]))
    torch.testing.assert_close(latent_distance_reward(source, target)(actions), naive, rtol=0, atol=1e-12)


def test_the_planners_reward_is_that_of_the_learned_evaluation():
    torch.manual_seed(0)
    source, target = states()
    network = PairEvaluation(channels=16, width=32).double()
    actions = torch.stack([action(1, 20), action(2, 20)])
    moved = VectorState(source.vectors[:, None], source.centroid[:, None]).after(actions)
    wide = VectorState(target.vectors[:, None].expand(-1, 20, -1, -1), target.centroid[:, None].expand(-1, 20, -1))
    naive = -network(moved, wide).detach()
    torch.testing.assert_close(network.reward(source, target)(actions), naive, rtol=0, atol=1e-12)


def test_the_evaluation_does_not_change_when_both_states_move_together():
    torch.manual_seed(0)
    source, target = states()
    network, both = PairEvaluation(channels=16, width=32).double(), action()
    torch.testing.assert_close(network(source.after(both), target.after(both)), network(source, target))
    assert not torch.allclose(network(source.after(both), target), network(source, target))


def test_the_planner_finds_a_motion_in_latent_space():
    encoder, source = VectorEncoder(), cloud()
    a = action(5) * 0.4
    reward = latent_distance_reward(encoder(source), encoder(move(source, a)))
    start, sigma = torch.zeros_like(a), torch.ones_like(a)
    found = plan(reward, start, sigma, iterations=10, candidates=1000, elites=25, generators=generators_of([0]))
    error = rotations_of(found.actions)[0].T @ rotations_of(a)[0]
    assert Rotation.from_matrix(error.detach().numpy()).magnitude() < 1e-3
    torch.testing.assert_close(found.actions[:, 3:], a[:, 3:], rtol=0, atol=1e-3)
