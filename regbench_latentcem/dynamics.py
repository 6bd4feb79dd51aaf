"""The latent dynamic model: the transformation network f, the evaluation network d, and the reward that they make."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from .actions import ACTION_SIZE
from .encoder import LATENT_SIZE
from .planner import Reward


class TransformationNetwork(nn.Module):
    """f([z, a]): the latent state after an action (Eq. 1). Three layers; the width is not stated in the paper.

    Args:
        width: Of the two hidden layers.
    """

    def __init__(self, *, width: int = 512) -> None:
        super().__init__()
        self.first = nn.Linear(LATENT_SIZE + ACTION_SIZE, width)
        self.second = nn.Linear(width, width)
        self.third = nn.Linear(width, LATENT_SIZE)

    def forward(self, latents: Tensor, actions: Tensor) -> Tensor:
        """Map (..., 512) latent states and (..., 6) actions to (..., 512) predicted states."""
        hidden = functional.relu(self.first(torch.cat([latents, actions], dim=-1)))
        predicted: Tensor = self.third(functional.relu(self.second(hidden)))
        return predicted


class EvaluationNetwork(nn.Module):
    """d([z', z]): the predicted Chamfer distance of two clouds (Eq. 2). Three layers, width not stated.

    Args:
        width: Of the two hidden layers.
    """

    def __init__(self, *, width: int = 512) -> None:
        super().__init__()
        self.first = nn.Linear(2 * LATENT_SIZE, width)
        self.second = nn.Linear(width, width)
        self.third = nn.Linear(width, 1)

    def forward(self, moved: Tensor, target: Tensor) -> Tensor:
        """Map (..., 512) states of the moved source and of the target to (...) distances."""
        hidden = functional.relu(self.first(torch.cat([moved, target], dim=-1)))
        distance: Tensor = self.third(functional.relu(self.second(hidden)))
        return distance.squeeze(-1)


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
        joint_bias = functional.linear(z_target, of_target, d.first.bias + of_moved @ f.third.bias)[:, None, :]

    @torch.no_grad()
    def reward(actions: Tensor) -> Tensor:
        hidden = torch.relu_(functional.linear(actions, of_action).add_(first_bias))
        hidden = torch.relu_(f.second(hidden))
        hidden = torch.relu_(functional.linear(hidden, joint_weight).add_(joint_bias))
        hidden = torch.relu_(d.second(hidden))
        distance: Tensor = d.third(hidden)
        return -distance.squeeze(-1)

    return reward
