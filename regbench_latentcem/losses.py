"""The losses of section 3.2, by their equation numbers.

All distances are means over points where the paper prints sums (Eq. 5): at 784 points a sum swamps the other terms.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from regbench.learning.layers.chamfer import chamfer_distance

from .actions import rotations_of
from .model import LatentModel

# Points of the moved source and of the target from which a tried action's Chamfer distance is estimated.
QUERIES = 96
# Of the proposed actions, those that the model likes best (where the planner would go), and as many others.
LIKED = 6


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
        predicted: (..., 512), f's.
        z_moved: (..., 512), the encoder's.
    """
    return (predicted - z_moved).square().sum(dim=-1).mean()


def relative_transformation_loss(predicted: Tensor, z_moved: Tensor) -> Tensor:
    """Eq. 6 relative to the states' own variance in the batch: 1 - R^2; scalar.

    As printed, the loss is least where all states are the same: the encoder shrank its states (their variance over
    512 dimensions fell to 0.1) and f learned nothing.

    Args:
        predicted: (..., 512), f's.
        z_moved: (..., 512), the encoder's.
    """
    variance = z_moved.flatten(0, -2).var(dim=0, correction=0).sum()
    return transformation_loss(predicted, z_moved) / (variance + torch.finfo(variance.dtype).eps)


def evaluation_loss(predicted: Tensor, distances: Tensor) -> Tensor:
    """Eq. 7 for one kind of pair: mean over the batch of I = (d(z, z_Y) - D_cd)^2; scalar.

    Args:
        predicted: (...), d's.
        distances: (...), Chamfer distances of the clouds.
    """
    return (predicted - distances).square().mean()


def training_losses(
    model: LatentModel, batch: Mapping[str, Tensor], *, decoded: int, states: Tensor | None = None
) -> dict[str, Tensor]:
    """Return the terms of Eq. 8 for a batch of samples (sampling.py), and one more; each a scalar, not weighted.

    Every copy serves as X', and as Y for the source, for the other copies and for tried actions. Gradients of every
    term reach the encoder: "we jointly train". (The paper writes L_trans(theta) and L_eval(psi), which could also mean
    that they do not.)

    Args:
        model: The networks, in training mode.
        batch: B samples, stacked.
        decoded: Clouds that the reconstruction is taken from, drawn by torch's generator; 0: without that term.
        states: (B, 1 + M, 512) states that are given instead of the encoder's (support.py). f is then not trained by
            d's errors.

    Returns:
        "reconstruction" (Eq. 4), "transformation" (Eq. 6, relative), "evaluation" (Eq. 7), and "prediction": as Eq. 7,
        of d on f's own predictions for tried actions, which is what the planner asks it.
    """
    source, copies, actions = batch["source"], batch["copies"], batch["actions"]
    clouds = torch.cat([source[:, None], copies], dim=1)  # (B, 1 + M, N, 3)
    given = states is not None
    if states is None:
        states = model.encode(clouds.flatten(0, 1)).view(*clouds.shape[:2], -1)
    z_source, z_copies = states[:, :1], states[:, 1:]

    first, second = torch.triu_indices(clouds.shape[1], clouds.shape[1], offset=1, device=clouds.device)
    ones, others = clouds[:, first], clouds[:, second]
    distances = nearest_distances(ones, others).mean(dim=-1) + nearest_distances(others, ones).mean(dim=-1)
    evaluated = model.evaluation(states[:, first], states[:, second])
    mirrored = model.evaluation(states[:, second], states[:, first])

    targets = batch["near"].shape[1]
    z_targets = z_copies[:, :targets, None]
    liked = _liked(model, z_source[:, :, None], z_targets, batch["proposed"])
    tried = torch.cat([batch["near"], liked, batch["proposed"][:, :, :LIKED]], dim=2)
    predicted_states = model.transformation(z_source[:, :, None], tried)
    predicted = model.evaluation(predicted_states.detach() if given else predicted_states, z_targets)

    chosen = torch.randperm(clouds.shape[0] * clouds.shape[1])[:decoded].to(clouds.device)
    whole, latents = clouds.flatten(0, 1)[chosen], states.flatten(0, 1)[chosen]
    reconstruction = {"reconstruction": reconstruction_loss(model.decoder(latents), whole)} if decoded else {}
    return {
        **reconstruction,
        "transformation": relative_transformation_loss(model.transformation(z_source, actions), z_copies),
        "evaluation": (evaluation_loss(evaluated, distances) + evaluation_loss(mirrored, distances)) / 2,
        "prediction": evaluation_loss(predicted, distances_after(source, copies[:, :targets], tried)),
    }


@torch.no_grad()
def _liked(model: LatentModel, z_source: Tensor, z_targets: Tensor, proposed: Tensor) -> Tensor:
    """Return the proposed actions of least predicted distance, (B, targets, LIKED, 6)."""
    predicted = model.evaluation(model.transformation(z_source, proposed), z_targets)
    best = predicted.topk(min(LIKED, proposed.shape[2]), dim=2, largest=False).indices
    return proposed.gather(2, best[..., None].expand(-1, -1, -1, proposed.shape[3]))


@torch.no_grad()
def distances_after(source: Tensor, targets: Tensor, actions: Tensor, queries: int = QUERIES) -> Tensor:
    """Estimate the Chamfer distances of moved sources from their targets.

    Unbiased: the means over the points are taken over some of them, drawn by torch's generator, each with its nearest
    among all points of the other cloud.

    Args:
        source: (B, N, 3).
        targets: (B, G, M, 3).
        actions: (B, G, A, 6).
        queries: Points in a mean, at most.

    Returns:
        (B, G, A).
    """
    rotations, translations = rotations_of(actions), actions[..., None, 3:]
    some_source = source[:, torch.randperm(source.shape[1], device=source.device)[:queries]][:, None, None]
    some_target = targets[:, :, torch.randperm(targets.shape[2], device=source.device)[:queries]][:, :, None]
    forth = some_source @ rotations.transpose(-1, -2) + translations  # (B, G, A, Q, 3)
    back = (some_target - translations) @ rotations
    to_target = nearest_distances(forth.flatten(2, 3), targets)
    to_source = nearest_distances(back.flatten(2, 3), source[:, None].expand(-1, targets.shape[1], -1, -1))
    distances: Tensor = to_target.view(forth.shape[:-1]).mean(dim=-1) + to_source.view(back.shape[:-1]).mean(dim=-1)
    return distances


@torch.no_grad()
def nearest_distances(points: Tensor, others: Tensor) -> Tensor:
    """Return the distance of each of (B, G, P, 3) points to the nearest of (B, G, N, 3) others, (B, G, P).

    By products of about seven digits: right to 1e-3 where clouds of unit extent touch.
    """
    half_squares = others.square().sum(dim=-1) / 2
    least = points.new_empty(points.shape[:-1])
    for index in np.ndindex(points.shape[:2]):  # one matrix at a time: it stays in the cache
        least[index] = torch.addmm(half_squares[index], points[index], others[index].T, alpha=-1).amin(dim=-1)
    return (points.square().sum(dim=-1) + 2 * least).clamp(min=0).sqrt()
