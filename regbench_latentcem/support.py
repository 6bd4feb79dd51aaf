"""The start of a training: the encoder as a support function, on which f and d learn before the encoder does.

h(n) = max over the points x of n . x, in 512 directions n, says how far a cloud reaches. It holds pose and shape, noise
and density change it little, and the DGCNN encoder can compute it exactly. It takes the extreme points of a cloud
alone, so f sees thousands of motions in the time of one step of the encoder.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import sph_harm_y
from torch import Tensor, nn

from regbench.learning.layers.edge_convolution import EdgeConvolution
from regbench.learning.layers.threads import as_many_as_torch

from .actions import move
from .encoder import LATENT_SIZE, DgcnnEncoder
from .losses import relative_transformation_loss
from .model import LatentModel
from .sampling import NOISE_CLIP, NOISE_SIGMA, START_ROTATION, draw_actions, variations
from .support_loops import largest_products

SLOPE = 0.2  # of LeakyReLU
EXTREME_POINTS = 96
# Spherical harmonics up to here, 121 of them, hold 97 % of what motions change in the support functions of shapes.
HIGHEST_DEGREE = 10
# Least squares of Chamfer distances by d's first answers; tests/latentcem/test_support.py fits it again.
SIZE_OF_D = 4.1
# Mean and standard deviation of the support functions' values over moved training shapes; tested there likewise.
MEAN_STATE, STATE_DEVIATION = 0.70, 0.19


@cache
def directions() -> Tensor:
    """Return 512 directions spread evenly over the sphere (a Fibonacci lattice), (512, 3) float32."""
    index = np.arange(LATENT_SIZE) + 0.5
    z, angle = 1 - 2 * index / LATENT_SIZE, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z * z)
    return torch.from_numpy(np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)).float()


@torch.no_grad()
def support_states(clouds: Tensor) -> Tensor:
    """Return the support functions of (B, N, 3) clouds, (B, 512), as an encoder that has just started says them."""
    towards = directions()
    if clouds.device.type == "cpu":
        heights = torch.empty(len(clouds), LATENT_SIZE)
        with as_many_as_torch():
            largest_products(clouds.float().contiguous().numpy(), towards.T.contiguous().numpy(), heights.numpy())
        heights = heights.to(clouds)
    else:
        heights = (towards.to(clouds) @ clouds.transpose(1, 2)).amax(dim=2)
    return nn.functional.leaky_relu(heights, SLOPE)


@torch.no_grad()
def start_as_support(model: LatentModel) -> None:
    """Set a model's first weights: z is the support function, d is a measure of z' - z.

    d is a weighted sum of the absolute values of the spherical harmonics of z' - z: positive and homogeneous. (Random
    directions in their place cost the planner 0.8 degrees.) Six channels of the first edge convolution carry +x, -x,
    .. of the point itself through the LeakyReLU; the last layer makes n . x of them. All other channels keep their
    random weights, with no share in z before they learn one.

    Raises:
        TypeError: The encoder is no DGCNN.
    """
    if not isinstance(model.encoder, DgcnnEncoder):
        raise TypeError("only the DGCNN encoder can start as a support function")
    convolution = model.encoder.convolutions[0]
    assert isinstance(convolution, EdgeConvolution)
    first = convolution.edge
    axes = torch.cat([torch.eye(3), -torch.eye(3)])
    first.weight[:6] = torch.cat([torch.zeros(6, 3), axes], dim=1)  # columns: neighbour - centre, centre
    last = model.encoder.last
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    last.weight[:, :6] = directions() @ axes.T / (1 + SLOPE)
    model.transformation.state_mean.fill_(MEAN_STATE)
    model.transformation.state_deviation.fill_(STATE_DEVIATION)
    d = model.evaluation
    half = len(d.first.weight) // 2
    moved = d.first.weight[:half, :LATENT_SIZE] * 2
    known = spherical_harmonics(HIGHEST_DEGREE)[:half]
    moved[: len(known)] = known
    d.first.weight.copy_(torch.cat([torch.cat([moved, -moved], dim=1), torch.cat([-moved, moved], dim=1)]))
    for layer, size in ((d.second, 2.0), (d.third, 2.0 * SIZE_OF_D)):
        nn.init.uniform_(layer.weight, 0, size / layer.in_features)
    for layer in (d.first, d.second, d.third):
        nn.init.zeros_(layer.bias)


def spherical_harmonics(highest_degree: int) -> Tensor:
    """Return the real spherical harmonics up to a degree in our 512 directions, (count, 512), of about unit norm."""
    x, y, z = directions().double().numpy().T
    polar, azimuth = np.arccos(z), np.arctan2(y, x)
    rows = []
    for degree in range(highest_degree + 1):
        for order in range(-degree, degree + 1):
            values = sph_harm_y(degree, abs(order), polar, azimuth) * (np.sqrt(2) if order else 1.0)
            rows.append(values.imag if order < 0 else values.real)
    return torch.from_numpy(np.stack(rows) * np.sqrt(4 * np.pi / LATENT_SIZE)).float()


def extreme_points(clouds: Iterable[NDArray[np.float64]]) -> Tensor:
    """Return the points of every cloud that reach farthest in a direction, (C, 96, 3) float32, repeated to 96.

    Clouds come about their centroids, in units of their extents.
    """
    towards = directions().numpy().T
    rows = []
    for cloud in clouds:
        centred = cloud - cloud.mean(axis=0)
        centred /= float(np.linalg.norm(centred, axis=1).max()) or 1.0
        found, counts = np.unique((centred.astype(np.float32) @ towards).argmax(axis=0), return_counts=True)
        most = found[np.argsort(-counts, kind="stable")][:EXTREME_POINTS]
        rows.append(centred[np.resize(most, EXTREME_POINTS)])
    return torch.from_numpy(np.stack(rows).astype(np.float32))


def support_transformation_loss(
    model: LatentModel, extremes: Tensor, *, clouds: int, copies: int, noisy: float, varied: bool = False
) -> Tensor:
    """Return Eq. 6 (relative) for f on support functions of drawn clouds and motions (torch's generator); scalar.

    Sources are turned by the benchmark's mean rotation first, as those of `draw_sample`. Under mixed precision f alone
    is in the lower one: motions and states need their digits.
    """

    def noise(like: Tensor, share: Tensor) -> Tensor:
        return share * (torch.randn(like.shape) * NOISE_SIGMA).clamp(-NOISE_CLIP, NOISE_CLIP).to(like)

    with torch.autocast(extremes.device.type, enabled=False):
        chosen = torch.randint(len(extremes), (clouds,), device="cpu")
        source = extremes[chosen.to(extremes.device)]
        if varied:
            source = source @ variations(torch.rand(clouds, 7)).to(source).transpose(1, 2)
            source = source / source.norm(dim=2).amax(dim=1)[:, None, None]
        source = source @ torch.from_numpy(START_ROTATION.T).to(source)
        with_noise = (torch.rand(clouds) < noisy).to(source)[:, None, None]
        actions = draw_actions((clouds, copies)).to(source)
        moved = move(source[:, None], actions)
        moved = moved + noise(moved, with_noise[:, None])
        z_source = support_states(source + noise(source, with_noise))
        z_moved = support_states(moved.flatten(0, 1)).view(clouds, copies, -1)
    return relative_transformation_loss(model.transformation(z_source[:, None], actions).float(), z_moved)
