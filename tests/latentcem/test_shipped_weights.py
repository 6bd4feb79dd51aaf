"""The weights in the package: as large as they may be, of today's networks, and good for what they are for."""

import pytest
import torch

from regbench.learning.weights import load_weights
from regbench.testing import Outcome, check_registrar, clouds
from regbench_latentcem.actions import move
from regbench_latentcem.loading import load_paper_model
from regbench_latentcem.model import LatentModel
from regbench_latentcem.registrar import LatentCem
from regbench_latentcem.sampling import START_ROTATION, draw_actions
from regbench_latentcem.weight_files import FOLDER

PAPER = ("modelnet40", "7scenes")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.safetensors")), ids=lambda path: path.stem)
def test_every_file_is_under_8_mb_and_as_its_card_says(path):
    assert path.stat().st_size < 8e6
    assert load_weights(path).card["sha256"]


@pytest.mark.parametrize("name", PAPER)
def test_an_action_on_the_points_and_in_latent_space_mean_the_same_motion(name):
    """Of fifty actions f's prediction for one is nearest to the state of the cloud moved by that one."""
    model = load_paper_model(name).eval()
    torch.manual_seed(0)
    for seed in range(3):
        body = clouds.body(784, seed=seed)
        cloud = torch.from_numpy((body - body.mean(axis=0)) @ START_ROTATION.T).float()
        cloud = cloud / cloud.norm(dim=1).max()
        actions = draw_actions((50,)).float()
        with torch.no_grad():
            moved = model.encode(move(cloud, actions))
            predicted = model.transformation(model.encode(cloud[None]), actions)
        nearest = torch.cdist(predicted, moved).argmin(dim=1)
        assert (nearest == torch.arange(50)).float().mean() > 0.9


@pytest.mark.parametrize("name", PAPER)
def test_the_method_conforms(name):
    results = check_registrar(LatentCem, {"weights": name, "N": 300})
    assert [result for result in results if result.outcome is Outcome.FAILED] == []


def test_an_untrained_f_would_not_pass_here():
    torch.manual_seed(0)
    model = LatentModel().eval()
    actions = draw_actions((50,)).float()
    cloud = torch.from_numpy(clouds.body(784)).float()
    with torch.no_grad():
        moved = model.encode(move(cloud, actions))
        predicted = model.transformation(model.encode(cloud[None]), actions)
    assert (torch.cdist(predicted, moved).argmin(dim=1) == torch.arange(50)).float().mean() < 0.5
