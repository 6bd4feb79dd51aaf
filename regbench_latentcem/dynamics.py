"""The latent dynamic model: the transformation network f, the evaluation network d, and the reward that they make."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from .actions import ACTION_SIZE
from .encoder import LATENT_SIZE
from .planner import Reward


class TransformationNetwork(nn.Module):
    """f([z, a]): the latent state after an action (Eq. 1). Three layers; their widths are not stated in the paper.

    They say how the state changes: f = z + layers([z, a]). Without that, what they cannot express of z itself is in
    every prediction. In the first layer an action is added to z's share, and stretches it too: what a small turn
    changes is the product of the angle and of something of the cloud. Both enter in units of their spread.

    Args:
        widths: Of the two hidden layers. The first costs the planner little: z's share of it is computed once.
        action_deviations: The spread of the angles, in radians, and of the translation, in extents.

    Attributes:
        state_mean: Of the states' components; 0 unless what makes the states sets it.
        state_deviation: Likewise; 1.
    """

    state_mean: Tensor
    state_deviation: Tensor
    action_deviations: Tensor

    def __init__(
        self, *, widths: tuple[int, int] = (1024, 256), action_deviations: tuple[float, float] = (0.25, 0.03)
    ) -> None:
        super().__init__()
        self.register_buffer("state_mean", torch.tensor(0.0))
        self.register_buffer("state_deviation", torch.tensor(1.0))
        self.register_buffer("action_deviations", torch.tensor(action_deviations).repeat_interleave(3))
        self.of_state = nn.Linear(LATENT_SIZE, widths[0])
        self.stretch = nn.Linear(ACTION_SIZE, widths[0], bias=False)
        self.shift = nn.Linear(ACTION_SIZE, widths[0], bias=False)
        self.second = nn.Linear(*widths)
        self.third = nn.Linear(widths[1], LATENT_SIZE)
        with torch.no_grad():  # little change before training
            self.third.weight.mul_(0.1)
            self.third.bias.zero_()

    def forward(self, latents: Tensor, actions: Tensor) -> Tensor:
        """Map (..., 512) latent states and (..., 6) actions, which may be broadcast, to (..., 512) predicted states."""
        share, units = self.share_of(latents), actions / self.action_deviations
        hidden = functional.relu(share * (1 + self.stretch(units)) + self.shift(units))
        change: Tensor = self.third(functional.relu(self.second(hidden)))
        return latents + change

    def share_of(self, latents: Tensor) -> Tensor:
        """Map (..., 512) latent states to their (..., W) share of the first layer."""
        share: Tensor = self.of_state((latents - self.state_mean) / self.state_deviation)
        return share

    def first_layer_of(self, latents: Tensor) -> tuple[Tensor, Tensor]:
        """Return the first layer that these latent states make, as a linear layer of the action alone.

        Args:
            latents: (P, 512).

        Returns:
            Its weights (P, W, 6) and biases (P, W).
        """
        share = self.share_of(latents)
        weights = share[:, :, None] * self.stretch.weight + self.shift.weight
        return weights / self.action_deviations, share


class EvaluationNetwork(nn.Module):
    """d([z', z]): the predicted Chamfer distance of two clouds (Eq. 2). Three layers, widths not stated.

    It starts as a function of z' - z: the two halves of its first layer are each other's opposites before training.

    Args:
        widths: Of the two hidden layers.
    """

    def __init__(self, *, widths: tuple[int, int] = (256, 64)) -> None:
        super().__init__()
        self.first = nn.Linear(2 * LATENT_SIZE, widths[0])
        self.second = nn.Linear(*widths)
        self.third = nn.Linear(widths[1], 1)
        with torch.no_grad():
            self.first.weight[:, LATENT_SIZE:] = -self.first.weight[:, :LATENT_SIZE]

    def forward(self, moved: Tensor, target: Tensor) -> Tensor:
        """Map (..., 512) states of the moved source and of the target, which may be broadcast, to (...) distances."""
        hidden = functional.relu(_linear_of_pair(self.first, moved, target))
        distance: Tensor = self.third(functional.relu(self.second(hidden)))
        return distance.squeeze(-1)


def _linear_of_pair(layer: nn.Linear, first: Tensor, second: Tensor) -> Tensor:
    """Return layer([first, second]) as a sum of two products: a state that many actions share is multiplied once."""
    of_first, of_second = layer.weight[:, : first.shape[-1]], layer.weight[:, first.shape[-1] :]
    return functional.linear(first, of_first, layer.bias) + functional.linear(second, of_second)


def learned_reward(f: TransformationNetwork, d: EvaluationNetwork, z_source: Tensor, z_target: Tensor) -> Reward:
    """Return r(a) = -d([f([z_X, a]), z_Y]) (Eq. 2) as a function of actions, for P pairs of latent states.

    What does not depend on the action is computed here, once: f's first layer as one of the action alone, and z_Y's
    share of d's. f's last layer and d's first are both linear, with nothing between: they are one product.

    Args:
        f: Transformation network.
        d: Evaluation network.
        z_source: (P, 512).
        z_target: (P, 512).

    Returns:
        A function from (P, N, 6) actions to (P, N) rewards, without gradients; one pair takes several rows of actions.
    """
    with torch.no_grad():
        of_action, of_source = f.first_layer_of(z_source)
        of_moved, of_target = d.first.weight.chunk(2, dim=1)
        joint_weight = of_moved @ f.third.weight
        joint_bias = functional.linear(z_target, of_target, d.first.bias + of_moved @ f.third.bias)
        joint_bias = (joint_bias + functional.linear(z_source, of_moved))[:, None, :]

    @torch.no_grad()
    def reward(actions: Tensor) -> Tensor:
        hidden = torch.relu_((actions @ of_action.mT).add_(of_source[:, None, :]))
        hidden = torch.relu_(f.second(hidden))
        hidden = torch.relu_(functional.linear(hidden, joint_weight).add_(joint_bias))
        hidden = torch.relu_(d.second(hidden))
        distance: Tensor = d.third(hidden)
        return -distance.squeeze(-1)

    return reward
