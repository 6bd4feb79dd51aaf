import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from regbench.geometry.se3 import transform
from regbench_latentcem.actions import motion_of
from regbench_latentcem.losses import evaluation_loss, losses, reconstruction_loss, transformation_loss
from regbench_latentcem.model import Configuration, LatentModel


def chamfer(x, y):
    return cKDTree(y).query(x)[0].mean() + cKDTree(x).query(y)[0].mean()


@pytest.fixture(scope="module")
def case():
    torch.manual_seed(0)
    model = LatentModel(Configuration(width=32))
    return model, torch.randn(2, 50, 3) * 0.5, torch.randn(2, 6), torch.randn(2, 40, 3) * 0.5


def test_terms_by_hand():
    assert transformation_loss(torch.tensor([[1.0, 2], [0, 0]]), torch.zeros(2, 2)).item() == 2.5  # (1 + 4 + 0) / 2
    assert evaluation_loss(torch.tensor([1.0, 2]), torch.tensor([0.0, 5])).item() == 5  # (1 + 9) / 2
    points = torch.tensor([[[0.0, 0, 0]], [[0, 0, 0]]])
    assert reconstruction_loss(points + torch.tensor([3.0, 4, 0]), points).item() == 10  # 5 each way


def test_every_term_is_its_equation(case):
    """Recomputed sample by sample in NumPy from the networks' answers, the moved clouds by regbench.geometry."""
    model, source, actions, target = case
    with torch.no_grad():
        terms = losses(model, source, actions, target, on_predictions=True)
        rec = trans = evaluation = prediction = 0.0
        for x, a, y in zip(source, actions, target, strict=True):
            x2 = torch.from_numpy(transform(motion_of(a), x)).float()
            z, z2, z_y = (model.encode(cloud[None]) for cloud in (x, x2, y))
            rec += sum(
                chamfer(model.decoder(latent)[0].numpy(), cloud.numpy())
                for latent, cloud in ((z, x), (z2, x2), (z_y, y))
            )
            predicted = model.transformation(z, a[None])
            trans += np.square((predicted - z2).numpy()).sum()
            near, moved = chamfer(x.numpy(), y.numpy()), chamfer(x2.numpy(), y.numpy())
            evaluation += (model.evaluation(z, z_y).item() - near) ** 2 + (
                model.evaluation(z2, z_y).item() - moved
            ) ** 2
            prediction += (model.evaluation(predicted, z_y).item() - moved) ** 2
    assert terms.reconstruction.item() == pytest.approx(rec / 2, rel=1e-4)
    assert terms.transformation.item() == pytest.approx(trans / 2, rel=1e-4)
    assert terms.evaluation.item() == pytest.approx(evaluation / 2, rel=1e-4)
    assert terms.prediction.item() == pytest.approx(prediction / 2, rel=1e-4)
    assert terms.total.item() == pytest.approx((rec + trans + evaluation + prediction) / 2, rel=1e-4)


def test_the_papers_loss_has_three_terms(case):
    terms = losses(*case)
    assert terms.prediction is None
    assert torch.equal(terms.total, terms.reconstruction + terms.transformation + terms.evaluation)


def test_every_parameter_gets_a_gradient(case):
    model = case[0]
    model.zero_grad()
    losses(*case).total.backward()
    assert [name for name, p in model.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0] == []


def test_a_few_steps_lower_the_loss(case):
    _, source, actions, target = case
    torch.manual_seed(0)
    model = LatentModel(Configuration(decoder="mlp", width=32))
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-3)
    values = []
    for _ in range(10):
        optimiser.zero_grad()
        loss = losses(model, source, actions, target).total
        loss.backward()
        optimiser.step()
        values.append(loss.item())
    assert values[-1] < 0.5 * values[0]
