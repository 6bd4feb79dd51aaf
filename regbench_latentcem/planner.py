"""The planner: the cross-entropy method over actions (the paper's Algorithm 1), for several pairs at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import torch
from torch import Tensor

# From (P, N, 6) actions to (P, N) rewards.
Reward: TypeAlias = Callable[[Tensor], Tensor]


@dataclass(frozen=True, eq=False)
class Plan:
    """What the planner found for P pairs.

    Attributes:
        means: (T + 1, P, 6), from mu_0 to mu_T.
        deviations: (T + 1, P, 6), from sigma_0 to sigma_T.
        elites: (T, P, K, 6), the K best actions of every iteration, best first.
        candidates: (T, P, N, 6), the actions they were taken from, or None where they were not kept.
    """

    means: Tensor
    deviations: Tensor
    elites: Tensor
    candidates: Tensor | None = None

    @property
    def actions(self) -> Tensor:
        """The answers, mu_T: (P, 6)."""
        return self.means[-1]


def plan(
    reward: Reward,
    mean: Tensor,
    deviation: Tensor,
    *,
    iterations: int,
    candidates: int,
    elites: int,
    generators: Sequence[torch.Generator],
    keep_candidates: bool = False,
) -> Plan:
    """Search the actions of greatest reward; Algorithm 1.

    Every pair draws from a generator of its own, on the CPU: its actions are the same alone, in a batch, and on any
    device.

    Args:
        reward: From (P, N, 6) actions to (P, N) rewards.
        mean: (P, 6), mu_0.
        deviation: (P, 6), sigma_0: one per dimension.
        iterations: T; 0 answers mu_0.
        candidates: N, actions drawn in an iteration.
        elites: K, the best of them that the next mean and deviation are taken from.
        generators: P generators on the CPU.
        keep_candidates: Whether the plan holds all candidates, for a picture of the search.

    Raises:
        ValueError: The numbers do not fit together, or rewards are not finite.
    """
    if not 1 <= elites <= candidates or iterations < 0:
        raise ValueError(f"the planner needs 1 <= K <= N and T >= 0, got K={elites}, N={candidates}, T={iterations}")
    if mean.shape != deviation.shape or len(generators) != len(mean):
        raise ValueError(f"{len(generators)} generators for means {tuple(mean.shape)}, sigmas {tuple(deviation.shape)}")
    means, deviations, chosen, kept = [mean], [deviation], [], []
    for _ in range(iterations):
        draws = torch.stack([torch.randn(candidates, mean.shape[1], generator=each) for each in generators])
        actions = means[-1][:, None, :] + deviations[-1][:, None, :] * draws.to(mean)
        rewards = reward(actions)
        if not torch.isfinite(rewards).all():
            raise ValueError("the planner's rewards are not finite")
        winners = rewards.topk(elites, dim=1).indices
        best = actions.gather(1, winners[:, :, None].expand(-1, -1, mean.shape[1]))
        chosen.append(best)
        if keep_candidates:
            kept.append(actions)
        # Eq. 9: mean and variance of the elites, both with 1/K.
        means.append(best.mean(dim=1))
        deviations.append(best.std(dim=1, correction=0))
    every = torch.stack(chosen) if chosen else mean.new_empty((0, len(mean), elites, mean.shape[1]))
    return Plan(torch.stack(means), torch.stack(deviations), every, torch.stack(kept) if kept else None)


def generators_of(seeds: Sequence[int]) -> list[torch.Generator]:
    """Return one CPU generator for each seed."""
    return [torch.Generator().manual_seed(seed) for seed in seeds]
