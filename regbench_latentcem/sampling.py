"""Training samples: a cloud, moved copies of it, the actions that moved them, and actions to try (section 3.2).

A sample <X, a, X', Y> of the paper is one copy as X' and another as Y: with M copies of one cloud there are M (M - 1)
such, for M + 1 runs of the encoder. All motions are self-made; no problem of a protocol is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from regbench.geometry.se3 import rotation_from_euler_deg
from regbench.protocols.draws import NOISE_CLIP, NOISE_SIGMA, draw_noise

Array = NDArray[np.float64]
Shape = tuple[int, ...]

__all__ = ["NOISE_CLIP", "NOISE_SIGMA", "Sampling", "draw_actions", "draw_sample"]

# The angles of the paper's benchmark, and a margin about them for the planner's first candidates. N(0, 1) rad, as the
# paper has it, spreads the same samples over all of SO(3).
BENCHMARK_RAD = (0.0, np.pi / 4)
TRAINED_RAD = (-0.3, np.pi / 4 + 0.3)
TRANSLATION = 0.03  # standard deviation, in extents: both clouds are centred


@dataclass(frozen=True)
class Sampling:
    """How samples are drawn.

    Attributes:
        copies: M, moved copies of a cloud; the last one by an angle of the whole trained range, the others by the
            benchmark's.
        targets: How many of them serve as Y for the tried actions.
        near: Actions tried for each target near the motion that made it: standard deviations from 0.01 to 0.6 rad.
        proposed: Actions of the whole trained range proposed for each target, of which some are tried.
        noisy: Share of the samples with noise on every cloud: Gaussian of 0.01, clipped at 0.05.
    """

    copies: int = 3
    targets: int = 2
    near: int = 8
    proposed: int = 128
    noisy: float = 0.5


def draw_sample(
    cloud: Array, points: int, sampling: Sampling, rng: np.random.Generator
) -> dict[str, NDArray[np.float32]]:
    """Return a sample's clouds and actions.

    Args:
        cloud: (N, 3), N >= points.
        points: Points of every cloud of the sample.
        sampling: How many of what.
        rng: The sample's own.

    Returns:
        float32: "source" (points, 3) about its centroid, of about unit extent; "copies" (M, points, 3); "actions"
        (M, 6), from the source to each copy; "near" (targets, near, 6) and "proposed" (targets, proposed, 6).
    """
    shape = cloud[rng.permutation(len(cloud))[:points]]
    noise = rng.random() < sampling.noisy
    shape = shape - shape.mean(axis=0)
    unit = float(np.linalg.norm(shape, axis=1).max()) or 1.0

    def measured(clean: Array) -> Array:
        seen = clean + draw_noise(clean.shape, rng) if noise else clean
        return seen / unit

    source = measured(shape)
    actions = np.concatenate(
        [_actions((sampling.copies - 1,), BENCHMARK_RAD, rng), _actions((1,), TRAINED_RAD, rng)], axis=0
    )
    moved = [
        measured(shape @ rotation_from_euler_deg(np.degrees(action[:3])).T + action[3:] * unit) for action in actions
    ]
    about = (sampling.targets, sampling.near)
    deviations = np.exp(rng.uniform(np.log(0.01), np.log(0.6), (*about, 1))) * np.repeat([1.0, 0.2], 3)
    result = {
        "source": source,
        "copies": np.stack(moved),
        "actions": actions,
        "near": actions[: sampling.targets, None, :] + rng.normal(size=(*about, 6)) * deviations,
        "proposed": _actions((sampling.targets, sampling.proposed), TRAINED_RAD, rng),
    }
    return {name: values.astype(np.float32) for name, values in result.items()}


def _actions(shape: Shape, angles_rad: tuple[float, float], rng: np.random.Generator) -> Array:
    return np.concatenate([rng.uniform(*angles_rad, (*shape, 3)), rng.normal(0, TRANSLATION, (*shape, 3))], axis=-1)


def draw_actions(shape: Shape) -> Tensor:
    """Return (*shape, 6) actions of the whole trained range, from torch's generator, on the CPU."""
    low, high = TRAINED_RAD
    return torch.cat([torch.rand(*shape, 3) * (high - low) + low, torch.randn(*shape, 3) * TRANSLATION], dim=-1)
