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
    every prediction.

    Args:
        widths: Of the two hidden layers. The first costs the planner little: z's share of it is computed once.
    """

    def __init__(self, *, widths: tuple[int, int] = (1024, 448)) -> None:
        super().__init__()
        self.first = nn.Linear(LATENT_SIZE + ACTION_SIZE, widths[0])
        self.second = nn.Linear(*widths)
        self.third = nn.Linear(widths[1], LATENT_SIZE)

    def forward(self, latents: Tensor, actions: Tensor) -> Tensor:
        """Map (..., 512) latent states and (..., 6) actions, which may be broadcast, to (..., 512) predicted states."""
        hidden = functional.relu(_linear_of_pair(self.first, latents, actions))
        change: Tensor = self.third(functional.relu(self.second(hidden)))
        return latents + change


class EvaluationNetwork(nn.Module):
    """d([z', z]): the predicted Chamfer distance of two clouds (Eq. 2). Three layers, widths not stated.

    It starts as a function of z' - z: the two halves of its first layer are each other's opposites before training.

    Args:
        widths: Of the two hidden layers.
    """

    def __init__(self, *, widths: tuple[int, int] = (256, 256)) -> None:
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

    What does not depend on the action is computed here, once: z_X's share of f's first layer and z_Y's of d's. f's
    last layer and d's first are both linear, with nothing between: they are one product.

    Args:
        f: Transformation network.
        d: Evaluation network.
        z_source: (P, 512).
        z_target: (P, 512).

    Returns:
        A function from (P, N, 6) actions to (P, N) rewards, without gradients.
    """
    with torch.no_grad():
        of_source, of_action = f.first.weight[:, :LATENT_SIZE], f.first.weight[:, LATENT_SIZE:]
        of_moved, of_target = d.first.weight.chunk(2, dim=1)
        first_bias = functional.linear(z_source, of_source, f.first.bias)[:, None, :]
        joint_weight = of_moved @ f.third.weight
        joint_bias = functional.linear(z_target, of_target, d.first.bias + of_moved @ f.third.bias)
        joint_bias = (joint_bias + functional.linear(z_source, of_moved))[:, None, :]

    @torch.no_grad()
    def reward(actions: Tensor) -> Tensor:
        hidden = torch.relu_(functional.linear(actions, of_action).add_(first_bias))
        hidden = torch.relu_(f.second(hidden))
        hidden = torch.relu_(functional.linear(hidden, joint_weight).add_(joint_bias))
        hidden = torch.relu_(d.second(hidden))
        distance: Tensor = d.third(hidden)
        return -distance.squeeze(-1)

    return reward
