import pytest
import torch

from regbench_latentcem.dynamics import EvaluationNetwork, TransformationNetwork, learned_reward
from regbench_latentcem.model import Configuration, LatentModel


@pytest.mark.parametrize("widths", [(64, 32), (512, 512)])
def test_the_planners_reward_is_that_of_the_two_networks(widths):
    torch.manual_seed(0)
    f, d = TransformationNetwork(widths=widths), EvaluationNetwork(widths=widths)
    z_source, z_target, actions = torch.randn(2, 512), torch.randn(2, 512), torch.randn(2, 30, 6)
    every_z_source, every_z_target = (z[:, None].expand(-1, 30, -1) for z in (z_source, z_target))
    f.state_mean.fill_(0.3)
    f.state_deviation.fill_(0.2)
    naive = -d(f(every_z_source, actions), every_z_target)  # Eq. 2
    reward = learned_reward(f, d, z_source, z_target)
    torch.testing.assert_close(reward(actions), naive.detach(), rtol=0, atol=1e-5)
    assert torch.equal(reward(actions), reward(actions))  # nothing is overwritten that the next call needs


def test_states_may_be_broadcast_over_actions():
    f, d = TransformationNetwork(widths=(64, 32)), EvaluationNetwork(widths=(64, 32))
    z, z_target, actions = torch.randn(2, 1, 512), torch.randn(2, 1, 512), torch.randn(2, 30, 6)
    f.state_mean.fill_(0.3)
    f.state_deviation.fill_(0.2)
    # As it is documented: f([z, a]) in units of the spread, an action stretches and shifts z's share, and a skip.
    share = f.of_state((z.expand(-1, 30, -1) - 0.3) / 0.2)
    units = actions / torch.tensor([0.25, 0.25, 0.25, 0.03, 0.03, 0.03])
    first = share + share * f.stretch(units) + f.shift(units)
    moved = z + f.third(f.second(first.relu()).relu())
    torch.testing.assert_close(f(z, actions), moved, rtol=0, atol=1e-4)
    joint = torch.cat([moved, z_target.expand(-1, 30, -1)], dim=2)
    torch.testing.assert_close(
        d(moved, z_target), d.third(d.second(d.first(joint).relu()).relu()).squeeze(2), rtol=0, atol=1e-5
    )


def test_before_training_d_sees_the_difference_of_two_states_alone():
    d = EvaluationNetwork()
    z, z_target, shift = torch.randn(3, 512), torch.randn(3, 512), torch.randn(512)
    torch.testing.assert_close(d(z + shift, z_target + shift), d(z, z_target), rtol=0, atol=1e-4)


def test_every_configuration_can_be_built_and_asked():
    clouds = torch.randn(2, 60, 3)
    for encoder in ("dgcnn", "folding"):
        for decoder in ("folding", "mlp"):
            model = LatentModel(
                Configuration(
                    encoder=encoder, decoder=decoder, transformation_widths=(64, 32), evaluation_widths=(32, 32)
                )
            )
            assert model.decoder(model.encode(clouds)).shape == (2, 784, 3)
            z = model.encode(clouds)
            assert model.reward(z, z)(torch.zeros(2, 5, 6)).shape == (2, 5)


@pytest.mark.parametrize(("dtype", "share"), [(torch.float64, 1e-5), (torch.bfloat16, 0.05)])
def test_other_precisions_stay_near_float32(dtype, share):
    """Off by at most a share of the answers' spread: f's states, d's distances, and the planner's rewards."""
    torch.manual_seed(0)
    f, d = TransformationNetwork(widths=(64, 32)), EvaluationNetwork(widths=(64, 32))
    f.state_mean.fill_(0.7)
    f.state_deviation.fill_(0.2)
    z_source, z_target = 0.7 + 0.2 * torch.randn(2, 512), 0.7 + 0.2 * torch.randn(2, 512)
    actions = torch.randn(2, 200, 6) * f.action_deviations

    def answers(of):
        states, targets, moves = z_source.to(of)[:, None], z_target.to(of)[:, None], actions.to(of)
        moved = f.to(of)(states, moves)
        reward = learned_reward(f, d.to(of), states[:, 0], targets[:, 0])(moves)
        return [values.detach().float() for values in (moved, d(moved, targets), reward)]

    for other, single in zip(answers(dtype), answers(torch.float32), strict=True):
        assert (other - single).abs().mean() <= share * single.std()
