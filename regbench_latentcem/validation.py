"""Figures on held-out clouds: the planner's errors, and how well the networks predict distances near and far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from regbench.metrics.rotation import euler_residuals_deg, rmse, rotation_error_deg

from .actions import rotations_of
from .losses import distances_after
from .model import LatentModel
from .planner import generators_of, plan
from .registrar import LatentCem
from .sampling import START_ROTATION, Sampling, draw_sample

Array = NDArray[np.float64]
KINDS = {"clean": 0.0, "noise": 1.0}
SEED = 5
FAR_ACTIONS = 16
AT_ONCE = 8


@dataclass(frozen=True, eq=False)
class ValidationPairs:
    """Pairs with known, self-made motions, without noise and with it.

    Attributes:
        batches: By kind ("clean", "noise"): the samples of sampling.py, stacked. The pair is the source and its first
            copy.
    """

    batches: dict[str, dict[str, Tensor]]

    @classmethod
    def of(cls, clouds: Sequence[Array], points: int) -> ValidationPairs:
        """Make the pairs: the same for the same clouds."""
        batches = {}
        for kind, noisy in KINDS.items():
            sampling = Sampling(copies=2, targets=1, near=FAR_ACTIONS, proposed=FAR_ACTIONS, noisy=noisy)
            samples = [
                draw_sample(cloud, points, sampling, np.random.Generator(np.random.PCG64([SEED, index])))
                for index, cloud in enumerate(clouds)
            ]
            names = samples[0].keys()
            batches[kind] = {name: torch.from_numpy(np.stack([sample[name] for sample in samples])) for name in names}
        return cls(batches)

    def figures(self, model: LatentModel) -> dict[str, float]:
        """Return the planner's errors with the registrar's parameters, and R^2 of predicted distances, by kind.

        "near": for actions about the motion that made the pair; "far": for actions of the whole range.
        "median_rotation_error_deg" is the mean of the kinds' medians.
        """
        found: dict[str, float] = {}
        for kind, batch in self.batches.items():
            found |= {f"{kind}_{name}": value for name, value in _figures(model, batch).items()}
        medians = [found[f"{kind}_median_rotation_error_deg"] for kind in self.batches]
        return {"median_rotation_error_deg": sum(medians) / len(medians), **found}


@torch.no_grad()
def _figures(model: LatentModel, batch: dict[str, Tensor]) -> dict[str, float]:
    device = next(model.parameters()).device
    here = {name: values.to(device) for name, values in batch.items()}
    centre = here["copies"][:, 0].mean(dim=1)
    source = here["source"] - here["source"].mean(dim=1, keepdim=True)
    target = here["copies"][:, 0] - centre[:, None]
    z_source, z_target = _encode(model, source), _encode(model, target)

    # Motions of the cloud before it was turned, as the benchmark gives them.
    truth = rotations_of(batch["actions"][:, 0].double()).numpy() @ START_ROTATION
    answers = rotations_of(_plan(model, z_source, z_target)).double().cpu().numpy() @ START_ROTATION
    errors = rotation_error_deg(answers, truth)
    found = {
        "median_rotation_error_deg": float(np.median(errors)),
        "rmse_r_deg": rmse(euler_residuals_deg(answers, truth)),
        "recall_5_deg": float((errors < 5).mean()),
    }
    near, far = here["near"][:, 0].clone(), here["proposed"][:, 0]
    near[..., 3:] -= centre[:, None]  # the target is centred here
    for where, actions in (("near", near), ("far", far)):
        predicted = -model.reward(z_source, z_target)(actions)
        true = distances_after(source, target[:, None], actions[:, None], source.shape[1])[:, 0]
        found[f"r2_{where}"] = _r2(predicted, true)
    return found


def _plan(model: LatentModel, z_source: Tensor, z_target: Tensor) -> Tensor:
    """Return the answers of the planner with the registrar's parameters, (P, 6)."""
    registrar, first_actions = LatentCem(), model.first_actions
    mean = torch.zeros(6).to(z_source)
    sigma0 = torch.tensor([first_actions.deviation_rad] * 3 + [first_actions.deviation_translation] * 3).to(z_source)
    answers = []
    for first in range(0, len(z_source), AT_ONCE):
        some = slice(first, min(first + AT_ONCE, len(z_source)))
        found = plan(
            model.reward(z_source[some], z_target[some]),
            mean.repeat(some.stop - first, 1),
            sigma0.repeat(some.stop - first, 1),
            iterations=registrar.T,
            candidates=registrar.N,
            elites=registrar.K,
            generators=generators_of(range(first, some.stop)),
        )
        answers.append(found.actions)
    return torch.cat(answers)


def _encode(model: LatentModel, clouds: Tensor) -> Tensor:
    return torch.cat([model.encode(clouds[first : first + AT_ONCE]) for first in range(0, len(clouds), AT_ONCE)])


def _r2(predicted: Tensor, true: Tensor) -> float:
    return float(1 - (predicted - true).square().sum() / (true - true.mean()).square().sum())
