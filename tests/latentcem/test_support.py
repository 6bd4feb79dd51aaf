import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull

from regbench_latentcem import support
from regbench_latentcem.actions import motion_of, move
from regbench_latentcem.losses import distances_after
from regbench_latentcem.model import Configuration, LatentModel
from regbench_latentcem.sampling import TRAINED_RAD
from regbench_latentcem.support import (
    directions,
    extreme_points,
    spherical_harmonics,
    start_as_support,
    support_states,
    support_transformation_loss,
)
from regbench_latentcem.training import LatentCemTraining


@pytest.fixture
def model():
    torch.manual_seed(0)
    model = LatentModel()
    start_as_support(model)
    return model


def cloud(points=300, batch=2):
    points = torch.randn(batch, points, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([0.3, 0.2, 0.1])
    return points - points.mean(dim=1, keepdim=True)


def test_the_encoder_starts_as_the_support_function(model):
    expected = (cloud() @ directions().T).amax(dim=1)  # positive: the centroid is inside
    torch.testing.assert_close(model.encode(cloud()), expected, rtol=0, atol=1e-6)
    torch.testing.assert_close(support_states(cloud()), expected, rtol=0, atol=1e-6)


def test_directions_are_even_over_the_sphere():
    towards = directions()
    torch.testing.assert_close(towards.norm(dim=1), torch.ones(512))
    torch.testing.assert_close(towards.T @ towards / 512, torch.eye(3) / 3, rtol=0, atol=1e-3)
    nearest = (towards @ towards.T - 2 * torch.eye(512)).amax(dim=1).arccos().rad2deg()
    assert 5 < nearest.min() <= nearest.max() < 11


def test_d_starts_positive_and_homogeneous_in_the_difference(model):
    z, z_target, shift = torch.rand(5, 512), torch.rand(5, 512), torch.rand(512)
    d = model.evaluation
    assert d(z, z).abs().max() < 1e-6
    torch.testing.assert_close(d(z + shift, z_target + shift), d(z, z_target), rtol=0, atol=1e-5)
    torch.testing.assert_close(d(z_target + 3 * (z - z_target), z_target), 3 * d(z, z_target), rtol=1e-4, atol=1e-5)
    assert (d(z, z_target) > 0).all()


def test_extreme_points_are_of_the_convex_hull_and_enough():
    points = cloud(batch=1)[0].double().numpy() * 7 + 3
    kept = extreme_points([points])
    assert kept.shape == (1, 96, 3)
    centred = points - points.mean(axis=0)
    centred /= np.linalg.norm(centred, axis=1).max()
    hull = {tuple(np.round(row, 5)) for row in centred[ConvexHull(centred).vertices]}
    assert {tuple(np.round(row, 5)) for row in kept[0].double().numpy()} <= hull
    whole = torch.from_numpy(centred[None]).float()
    torch.testing.assert_close(support_states(kept), support_states(whole), rtol=0, atol=1e-6)


def test_the_loss_is_that_of_f_on_states_of_moved_clouds(model):
    extremes = extreme_points(cloud(batch=1).double().numpy())

    torch.manual_seed(1)
    loss = support_transformation_loss(model, extremes, clouds=3, copies=4, noisy=0.0)
    torch.manual_seed(1)
    torch.randint(1, (3,))
    torch.rand(3)
    actions = torch.cat([(2 * torch.rand(3, 4, 3) - 1) * TRAINED_RAD, torch.randn(3, 4, 3) * 0.03], dim=2)
    turned = extremes @ torch.from_numpy(motion_of([np.pi / 8] * 3 + [0.0] * 3)[:3, :3].T).float()
    z_moved = support_states(move(turned[0], actions.flatten(0, 1)))
    predicted = model.transformation(support_states(turned), actions.flatten(0, 1))
    variance = z_moved.var(dim=0, correction=0).sum()
    expected = (predicted - z_moved).square().sum(dim=1).mean() / variance
    assert loss.item() == pytest.approx(expected.item(), rel=1e-4)


def test_only_dgcnn_can_start_so():
    with pytest.raises(TypeError, match="DGCNN"):
        start_as_support(LatentModel(Configuration(encoder="folding")))


def test_spherical_harmonics_are_orthonormal_and_of_their_degree():
    rows = spherical_harmonics(10)
    assert rows.shape == (121, 512)
    torch.testing.assert_close(rows @ rows.T, torch.eye(121), rtol=0, atol=0.02)
    linear = rows[1:4] / rows[1:4].norm(dim=1, keepdim=True)  # degree 1: y, z, x in some order and sign
    towards = directions().T / directions().norm(dim=0)[:, None]
    assert (linear @ towards.T).abs().amax(dim=1).min() > 0.999


def test_ds_first_answers_are_of_the_size_of_chamfer_distances(model, prepared_data):
    """The factor that fits them best to the distances of moved training shapes from their targets is about 1."""
    trainable = LatentCemTraining({}, data=prepared_data)
    rng = np.random.default_rng(0)
    predicted, true = [], []
    for _ in range(24):
        sample = {name: torch.from_numpy(values)[None] for name, values in trainable.sample(rng, 0.0).items()}
        source, target, near = sample["source"], sample["copies"][:, :1], sample["near"][:, :1]
        true.append(distances_after(source, target, near, source.shape[1])[0, 0])
        predicted.append(model.evaluation(support_states(move(source, near[0, 0])), support_states(target[0])))
    d, chamfer = torch.cat(predicted).detach(), torch.cat(true)
    factor = (d @ chamfer / (d @ d)).item()
    assert factor == pytest.approx(1, abs=0.15)
    assert (d * factor - chamfer).square().mean() < 0.2 * chamfer.var()


def test_under_mixed_precision_motions_and_states_keep_their_digits(model, monkeypatch):
    seen = []
    monkeypatch.setattr(support, "support_states", lambda clouds: seen.append(clouds) or support_states(clouds))
    extremes = extreme_points(cloud(batch=1).double().numpy())
    for mixed in (False, True):
        torch.manual_seed(1)
        with torch.autocast("cpu", torch.bfloat16, enabled=mixed):
            support_transformation_loss(model, extremes, clouds=4, copies=2, noisy=0.5)
    assert all(clouds.dtype == torch.float32 for clouds in seen)
    for full, under_autocast in zip(seen[:2], seen[2:], strict=True):
        assert torch.equal(full, under_autocast)


def test_states_enter_f_in_units_of_their_spread(model, prepared_data):
    trainable = LatentCemTraining({}, data=prepared_data)
    rng = np.random.default_rng(0)
    clouds = [trainable.sample(rng, 0.0)["copies"][0] for _ in range(48)]
    states = support_states(torch.from_numpy(np.stack(clouds)))
    f = model.transformation
    assert f.state_mean.item() == pytest.approx(states.mean().item(), abs=0.03)
    assert f.state_deviation.item() == pytest.approx(states.std().item(), abs=0.03)


def test_varied_sources_are_other_clouds_of_the_same_extent(model, monkeypatch):
    """The sources that f is shown: of extent 1 as before, and not only turned."""
    seen = []
    monkeypatch.setattr(support, "support_states", lambda clouds: seen.append(clouds) or support_states(clouds))
    extremes = extreme_points(cloud(batch=1).double().numpy())
    for varied in (False, True):
        support_transformation_loss(model, extremes, clouds=4, copies=2, noisy=0.0, varied=varied)
    plain, other = seen[0], seen[2]
    for sources in (plain, other):
        torch.testing.assert_close(sources.norm(dim=2).amax(dim=1), torch.ones(4), rtol=0, atol=1e-5)
    shapes = [torch.linalg.svdvals(sources) for sources in (plain, other)]
    assert (shapes[0] - shapes[0][0]).abs().max() < 1e-4
    assert (shapes[1] - shapes[0]).abs().amax(dim=1).min() > 0.01
