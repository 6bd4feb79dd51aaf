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

from regbench.geometry.se3 import euler_deg_from_rotation, rotation_from_euler_deg
from regbench.protocols.draws import NOISE_CLIP, NOISE_SIGMA, draw_noise

from .actions import rotations_of
from .model import BENCHMARK_MEAN_RAD

Array = NDArray[np.float64]
Shape = tuple[int, ...]

__all__ = ["NOISE_CLIP", "NOISE_SIGMA", "Sampling", "draw_actions", "draw_sample", "variations"]

# A source is turned by the benchmark's mean rotation; what is left of the benchmark's motions has angles of up to 0.58
# rad, their standard deviations 0.21 to 0.24. Trained actions are uniform up to this. N(0, 1) rad, as the paper has it,
# spreads the same samples over all of SO(3).
TRAINED_RAD = 0.55
START_ROTATION = rotation_from_euler_deg([np.degrees(BENCHMARK_MEAN_RAD)] * 3)
# A varied cloud is stretched along each axis by up to this factor, or shrunk, and turned by up to so many radians.
MOST_STRETCHED, MOST_TURNED_RAD = 1.3, 0.5
TRANSLATION = 0.03  # standard deviation, in extents: both clouds are centred


@dataclass(frozen=True)
class Sampling:
    """How samples are drawn.

    Attributes:
        copies: M, moved copies of a cloud; the last one by an angle of the whole trained range, the others by the
            benchmark's motions.
        targets: How many of them serve as Y for the tried actions.
        near: Actions tried for each target near the motion that made it: standard deviations from 0.01 to 0.6 rad.
        proposed: Actions of the whole trained range proposed for each target, of which some are tried.
        noisy: Share of the samples with noise on every cloud: Gaussian of 0.01, clipped at 0.05.
        varied: Whether clouds are varied before anything else, see `variations`: where there are few.
    """

    copies: int = 3
    targets: int = 2
    near: int = 8
    proposed: int = 128
    noisy: float = 0.5
    varied: bool = False


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
        float32: "source" (points, 3) about its centroid, of about unit extent, turned by the benchmark's mean
        rotation; "copies" (M, points, 3); "actions" (M, 6), from the source to each copy; "near" (targets, near, 6)
        and "proposed" (targets, proposed, 6).
    """
    shape = cloud[rng.permutation(len(cloud))[:points]]
    if sampling.varied:
        # About unit extent before and after: noise has its size in relation to the cloud.
        extent = float(np.linalg.norm(shape - shape.mean(axis=0), axis=1).max())
        shape = shape @ variations(torch.from_numpy(rng.random((1, 7))))[0].numpy().T
        shape *= extent / (float(np.linalg.norm(shape - shape.mean(axis=0), axis=1).max()) or 1.0)
    noise = rng.random() < sampling.noisy
    shape = (shape - shape.mean(axis=0)) @ START_ROTATION.T
    unit = float(np.linalg.norm(shape, axis=1).max()) or 1.0

    def measured(clean: Array) -> Array:
        seen = clean + draw_noise(clean.shape, rng) if noise else clean
        return seen / unit

    source = measured(shape)
    actions = np.concatenate([_of_the_benchmark(sampling.copies - 1, rng), _actions((1,), rng)], axis=0)
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
        "proposed": _actions((sampling.targets, sampling.proposed), rng),
    }
    return {name: values.astype(np.float32) for name, values in result.items()}


def _of_the_benchmark(count: int, rng: np.random.Generator) -> Array:
    """Return actions that follow the start to motions of the benchmark's angles, (count, 6)."""
    rotations = np.stack([rotation_from_euler_deg(angles) for angles in rng.uniform(0, 45, (count, 3))])
    angles = np.radians(euler_deg_from_rotation(rotations @ START_ROTATION.T))
    return np.concatenate([angles, _translations((count,), rng)], axis=1)


def _actions(shape: Shape, rng: np.random.Generator) -> Array:
    return np.concatenate([rng.uniform(-TRAINED_RAD, TRAINED_RAD, (*shape, 3)), _translations(shape, rng)], axis=-1)


def _translations(shape: Shape, rng: np.random.Generator) -> Array:
    return rng.normal(0, TRANSLATION, (*shape, 3))


def variations(uniform: Tensor) -> Tensor:
    """Return linear maps that make other clouds of a cloud: stretched along its axes, turned, half of them mirrored.

    Args:
        uniform: (..., 7), random numbers from 0 to 1.

    Returns:
        (..., 3, 3).
    """
    either_way = 2 * uniform - 1
    stretches = MOST_STRETCHED ** either_way[..., :3]
    mirrored = torch.where(either_way[..., 3:4] < 0, torch.tensor([-1.0, 1.0, 1.0]).to(uniform), 1.0)
    rotations = rotations_of(torch.cat([either_way[..., 4:] * MOST_TURNED_RAD, torch.zeros_like(uniform[..., :3])], -1))
    return rotations * (stretches * mirrored)[..., None, :]


def draw_actions(shape: Shape) -> Tensor:
    """Return (*shape, 6) actions of the whole trained range, from torch's generator, on the CPU."""
    angles = (2 * torch.rand(*shape, 3) - 1) * TRAINED_RAD
    return torch.cat([angles, torch.randn(*shape, 3) * TRANSLATION], dim=-1)
