"""The losses of section 3.2, by their equation numbers.

All distances are means over points where the paper prints sums (Eq. 5): at 784 points a sum swamps the other terms.
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from regbench.learning.chamfer import chamfer_distance

from .actions import move
from .model import LatentModel


def reconstruction_loss(decoded: Tensor, clouds: Tensor) -> Tensor:
    """Eq. 4 for one kind of cloud: mean over the batch of D_cd(dec(enc(X)), X); scalar.

    Args:
        decoded: (B, P, 3).
        clouds: (B, N, 3).
    """
    return chamfer_distance(decoded, clouds).mean()


def transformation_loss(predicted: Tensor, z_moved: Tensor) -> Tensor:
    """Eq. 6: mean over the batch of |f([z_X, a]) - z_X'|^2, a sum over the latent's dimensions; scalar.

    A mean over the 512 dimensions starves f.

    Args:
        predicted: (B, 512), f's.
        z_moved: (B, 512), the encoder's.
    """
    return (predicted - z_moved).square().sum(dim=-1).mean()


def evaluation_loss(predicted: Tensor, distances: Tensor) -> Tensor:
    """Eq. 7 for one kind of pair: mean over the batch of I = (d(z, z_Y) - D_cd)^2; scalar.

    Args:
        predicted: (B,), d's.
        distances: (B,), Chamfer distances of the clouds.
    """
    return (predicted - distances).square().mean()


@dataclass(frozen=True, eq=False)
class Losses:
    """The terms of Eq. 8, scalars.

    Attributes:
        reconstruction: Eq. 4.
        transformation: Eq. 6.
        evaluation: Eq. 7.
        prediction: As Eq. 7, of d on f's own prediction of X'; no term of the paper. None where it was not asked for.
    """

    reconstruction: Tensor
    transformation: Tensor
    evaluation: Tensor
    prediction: Tensor | None = None

    @property
    def total(self) -> Tensor:
        """Eq. 8: the plain sum."""
        total = self.reconstruction + self.transformation + self.evaluation
        return total if self.prediction is None else total + self.prediction


def losses(
    model: LatentModel, source: Tensor, actions: Tensor, target: Tensor, *, on_predictions: bool = False
) -> Losses:
    """Return the losses of samples <X, a, X', Y>, with X' = R(e) X + t. No ground truth of the pair X, Y enters.

    Gradients of every term reach the encoder: "we jointly train". (The paper writes L_trans(theta) and L_eval(psi),
    which could also mean that they do not.)

    Args:
        model: The networks, in training mode.
        source: (B, N, 3) clouds X.
        actions: (B, 6).
        target: (B, M, 3) clouds Y.
        on_predictions: Train d also on f([z_X, a]), which is what the planner asks it.
    """
    moved = move(source, actions)
    z_source, z_moved, z_target = model.encode(source), model.encode(moved), model.encode(target)
    predicted = model.transformation(z_source, actions)
    distances, moved_distances = chamfer_distance(source, target), chamfer_distance(moved, target)
    d = model.evaluation
    return Losses(
        reconstruction=reconstruction_loss(model.decoder(z_source), source)
        + reconstruction_loss(model.decoder(z_moved), moved)
        + reconstruction_loss(model.decoder(z_target), target),
        transformation=transformation_loss(predicted, z_moved),
        evaluation=evaluation_loss(d(z_source, z_target), distances)
        + evaluation_loss(d(z_moved, z_target), moved_distances),
        prediction=evaluation_loss(d(predicted, z_target), moved_distances) if on_predictions else None,
    )
