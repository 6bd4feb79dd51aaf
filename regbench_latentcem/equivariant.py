"""The equivariant model: a latent state that turns with its cloud, so that the transformation network is exact.

The state of a cloud is C vectors and a point: z_c = mean over points x of w_c(invariants of x) (x - centroid), and
the centroid. After an action (e, t) on the cloud it is R(e) z_c and R(e) centroid + t: nothing has to be learned for
that. (Rotation-equivariant features; Deng et al. 2021, Zhu et al. 2022.) What is learned is how the z_c are mixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from regbench.learning.layers.weighted_kabsch import rotation_of_covariance

from .actions import rotations_of
from .invariants import GROUPS, INVARIANTS, local_invariants
from .planner import Reward

# Chosen with `scale` on ModelNet40's training shapes, noisy and resampled, by the closed form's median error. Narrow
# windows move with the noise: their frequencies are low.
FREQUENCIES = (2.0, 1.5, 1.0, 0.5)


@dataclass(frozen=True, eq=False)
class VectorState:
    """Latent states of P clouds (or of P clouds after N actions each: further leading dimensions).

    Attributes:
        vectors: (..., C, 3), which turn with the cloud.
        centroid: (..., 3), which moves with the cloud.
    """

    vectors: Tensor
    centroid: Tensor

    def after(self, actions: Tensor) -> VectorState:
        """Return f(z, a), exactly the state of the moved cloud, for (..., 6) actions."""
        rotations = rotations_of(actions)
        turned = (rotations @ self.centroid[..., None]).squeeze(-1)
        return VectorState(self.vectors @ rotations.transpose(-1, -2), turned + actions[..., 3:])


class VectorEncoder(nn.Module):
    """A cloud to its vectors; w_c = cos(W_c . invariants + b_c), random features of a Gaussian kernel.

    (Rahimi and Recht 2007.) As it is built the encoder is untrained: W and b are random numbers of a fixed seed, and
    the mixing matrix, which takes the place of the channels' metric, is the identity. `fitting` learns the matrix.

    Args:
        channels: C, number of vectors.
        scale: Standard deviation of W_c over all invariants, times the square root of their number; each group of
            invariants then has its factor in `FREQUENCIES`.
        isotropy: See `isotropic`; None leaves the vectors as they are.
        seed: Of W and b.
    """

    def __init__(
        self, *, channels: int = 1024, scale: float = 24.0, isotropy: float | None = 0.1, seed: int = 0
    ) -> None:
        super().__init__()
        self.isotropy = isotropy
        rng = np.random.Generator(np.random.PCG64(seed))
        weight = rng.normal(0, scale / INVARIANTS**0.5, (channels, INVARIANTS)) * np.repeat(FREQUENCIES, GROUPS)
        self.weight = nn.Parameter(torch.from_numpy(weight))
        self.phase = nn.Parameter(torch.from_numpy(rng.uniform(0, 2 * np.pi, channels)))
        self.mixing = nn.Parameter(torch.eye(channels, dtype=torch.float64))

    def forward(self, clouds: Tensor) -> VectorState:
        """Map (B, N, 3) clouds of about unit extent to their states, whatever the order of the points."""
        centroid = clouds.mean(dim=1)
        vectors = self.mixing @ self.channels(clouds - centroid[:, None])
        return VectorState(vectors if self.isotropy is None else isotropic(vectors, self.isotropy), centroid)

    def channels(self, centred: Tensor) -> Tensor:
        """Map (B, N, 3) centred clouds to their vectors as they are before any mixing: (B, C, 3)."""
        weights = (local_invariants(centred) @ self.weight.T + self.phase).cos()  # (B, N, C)
        return weights.transpose(1, 2) @ centred / centred.shape[1]


def isotropic(vectors: Tensor, floor: float) -> Tensor:
    """Return (P, C, 3) vectors stretched so that they reach about equally far in every direction.

    z (G + floor tr(G)/3 I)^(-1/2) with G = z^T z: it turns with z, as z G^(-1/2) of turned vectors is turned. The
    latent distance of raw vectors is a long valley (they point along the cloud's long axis, and a turn about it costs
    little), and the planner's axis-parallel Gaussian gets stuck in it. With floor = 0 the distance is the same for
    every axis of rotation; weak directions, which noise moves most, then weigh as much as strong ones.
    """
    G = vectors.transpose(1, 2) @ vectors
    values, axes = torch.linalg.eigh(G)
    # Vectors under a millionth of the extent are rounding errors (of a symmetric cloud): they stay small.
    lifted = values.clamp(min=0) + floor * values.mean(dim=1, keepdim=True) + 1e-12 * vectors.shape[1]
    stretch: Tensor = axes * lifted.rsqrt()[:, None, :] @ axes.transpose(1, 2)
    return vectors @ stretch


def closed_form(source: VectorState, target: VectorState) -> tuple[Tensor, Tensor]:
    """Return the motions that best map source states onto target states: (P, 3, 3) and (P, 3).

    The rotation minimises the sum over c of |R z_X - z_Y|^2 (Kabsch 1976, without centring: these are vectors, not
    points); the translation then maps centroid onto centroid.
    """
    rotations = rotation_of_covariance(target.vectors.transpose(1, 2) @ source.vectors)
    return rotations, target.centroid - (rotations @ source.centroid[:, :, None]).squeeze(2)


def latent_distance(moved: VectorState, target: VectorState) -> Tensor:
    """Return d(z', z_Y) of the untrained model: squared distance of the states, (...).

    sum over c of |z'_c - z_Y,c|^2 relative to sum over c of |z_Y,c|^2, plus the centroids' squared distance.
    """
    size = target.vectors.square().sum(dim=(-1, -2)) + torch.finfo(target.vectors.dtype).tiny
    between = (moved.vectors - target.vectors).square().sum(dim=(-1, -2))
    return between / size + (moved.centroid - target.centroid).square().sum(dim=-1)


def latent_distance_reward(source: VectorState, target: VectorState) -> Reward:
    """Return r(a) = -latent_distance(f(z_X, a), z_Y) as a function of actions, for P pairs.

    |R z_X - z_Y|^2 = |z_X|^2 + |z_Y|^2 - 2 <R, M> with M = sum over c of z_Y z_X^T, computed here once: a candidate
    then costs the same whatever C.
    """
    with torch.no_grad():
        squares = target.vectors.square().sum(dim=(1, 2))
        size = squares + torch.finfo(squares.dtype).tiny
        constant = ((source.vectors.square().sum(dim=(1, 2)) + squares) / size)[:, None]
        M = (target.vectors.transpose(1, 2) @ source.vectors / size[:, None, None])[:, None]

    @torch.no_grad()
    def reward(actions: Tensor) -> Tensor:
        rotations = rotations_of(actions)
        centroid = (rotations @ source.centroid[:, None, :, None]).squeeze(-1) + actions[..., 3:]
        off_centre = (centroid - target.centroid[:, None]).square().sum(dim=2)
        return 2 * (rotations * M).sum(dim=(2, 3)) - constant - off_centre

    return reward
