import pytest
import torch

from regbench_latentcem.dynamics import EvaluationNetwork, TransformationNetwork, learned_reward
from regbench_latentcem.model import Configuration, LatentModel


@pytest.mark.parametrize("width", [64, 512])
def test_the_planners_reward_is_that_of_the_two_networks(width):
    torch.manual_seed(0)
    f, d = TransformationNetwork(width=width), EvaluationNetwork(width=width)
    z_source, z_target, actions = torch.randn(2, 512), torch.randn(2, 512), torch.randn(2, 30, 6)
    every_z_source, every_z_target = (z[:, None].expand(-1, 30, -1) for z in (z_source, z_target))
    naive = -d(f(every_z_source, actions), every_z_target)  # Eq. 2
    reward = learned_reward(f, d, z_source, z_target)
    torch.testing.assert_close(reward(actions), naive.detach(), rtol=0, atol=1e-5)
    assert torch.equal(reward(actions), reward(actions))  # nothing is overwritten that the next call needs


def test_every_configuration_can_be_built_and_asked():
    clouds = torch.randn(2, 60, 3)
    for encoder in ("dgcnn", "folding"):
        for decoder in ("folding", "mlp"):
            model = LatentModel(Configuration(encoder=encoder, decoder=decoder, width=32))
            assert model.decoder(model.encode(clouds)).shape == (2, 784, 3)
            z = model.encode(clouds)
            assert model.reward(z, z)(torch.zeros(2, 5, 6)).shape == (2, 5)
