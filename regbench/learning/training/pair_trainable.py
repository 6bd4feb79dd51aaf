"""The part of a training that all methods which align two clouds at once have in common: pairs, validation, card."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field
from torch import Tensor, nn

from regbench.learning.pair_network import PairNetwork
from regbench.learning.training.clouds import DatasetName, TrainingClouds
from regbench.learning.training.pair_samples import Kind, Motions, draw_pair
from regbench.learning.training.recipe import read_table
from regbench.learning.training.trainable import Sample, Trainable
from regbench.metrics.rotation import euler_residuals_deg, mae, rmse, rotation_error_deg

SEED = 5
VALIDATED_AT_ONCE = 8


class PairSettings(BaseModel):
    """The [method] table of a recipe; a method's own settings are added by a class derived from this.

    Attributes:
        dataset: "modelnet40" (its training split) or "7scenes" (the protocol's 296 training scans).
        held_out: Clouds of them that training never sees: validation.
        validated: How many of those are validated each time, as a pair of each kind.
        points: Points of the shape that a training pair is made from.
        validated_points: The same for validation, where they are as many as the benchmark's.
        kinds: Of pairs, in equal shares.
        motions: Of training pairs; see `draw_pair`. Validation has the benchmark's, "about_mean" where training has.
        most_rad: Largest angle of motions = "twist".
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    dataset: DatasetName = "modelnet40"
    held_out: int = Field(300, ge=1)
    validated: int = Field(64, ge=1)
    points: int = Field(784, ge=32, le=1024)
    validated_points: int = Field(784, ge=32, le=1024)
    kinds: list[Kind] = Field(["clean", "noise"], min_length=1)
    motions: Motions = "benchmark"
    most_rad: float = Field(0.8, gt=0)


class PairTrainable(Trainable):
    """A learned method that aligns two clouds at once. It brings `network`, `losses` and, if it has any, settings.

    The network's `configuration`, keyword arguments of its class, goes into the model card.

    Attributes:
        supervision: Whether training used the true motions.
        settings_class: `PairSettings`, or a class derived from it.
    """

    monitor = "mean_rotation_error_deg"
    name: ClassVar[str]
    supervision: ClassVar[Literal["supervised", "unsupervised"]]
    settings_class: ClassVar[type[PairSettings]] = PairSettings

    def __init__(self, settings: Mapping[str, Any], *, data: Path) -> None:
        super().__init__(settings, data=data)
        self.table = read_table(self.settings_class, settings, f"{self.name}: [method]")
        self.settings = self.table.model_dump()

    @abstractmethod
    def configuration(self) -> dict[str, Any]:
        """Return the keyword arguments that the network is built with."""

    def sample(self, rng: np.random.Generator, progress: float) -> Sample:
        """Return a pair made from a training cloud; see `draw_pair`."""
        table, trained = self.table, self._clouds.trained
        cloud = self._clouds.cloud(int(trained[rng.integers(len(trained))]))
        kind = table.kinds[rng.integers(len(table.kinds))]
        return cast(Sample, draw_pair(cloud, table.points, kind, table.motions, table.most_rad, rng))

    def validate(self, network: nn.Module) -> dict[str, float]:
        """Return errors on held-out clouds for each kind of pair, and the mean angle over all."""
        found: dict[str, float] = {}
        every = []
        for kind, batch in self._pairs.items():
            answers = _answers(cast(PairNetwork, network), batch)
            truth = batch["T_target_source"][:, :3, :3].double().numpy()
            errors = rotation_error_deg(answers, truth)
            every.append(errors)
            found |= {
                f"{kind}_mean_rotation_error_deg": float(errors.mean()),
                f"{kind}_median_rotation_error_deg": float(np.median(errors)),
                f"{kind}_rmse_r_deg": rmse(euler_residuals_deg(answers, truth)),
                f"{kind}_mae_r_deg": mae(euler_residuals_deg(answers, truth)),
                f"{kind}_recall_5_deg": float((errors < 5).mean()),
            }
        return {self.monitor: float(np.concatenate(every).mean()), **found}

    def card(self) -> dict[str, Any]:
        """Return data, split, supervision and configuration."""
        return {
            "method": self.name,
            "supervision": self.supervision,
            "configuration": self.configuration(),
            "data": self._clouds.card(),
        }

    @cached_property
    def _clouds(self) -> TrainingClouds:
        table = self.table
        most = max(table.points, table.validated_points)
        return TrainingClouds(table.dataset, self.data, most, table.held_out, f"{self.name}: [method]")

    @cached_property
    def _pairs(self) -> dict[str, dict[str, Tensor]]:
        """Validation pairs by kind: the same for the same settings."""
        table = self.table
        motions: Motions = "about_mean" if table.motions == "about_mean" else "benchmark"
        batches: dict[str, dict[str, Tensor]] = {}
        for kind in dict.fromkeys(table.kinds):
            pairs = [
                draw_pair(
                    self._clouds.cloud(int(index)),
                    table.validated_points,
                    kind,
                    motions,
                    table.most_rad,
                    np.random.Generator(np.random.PCG64([SEED, place])),
                )
                for place, index in enumerate(self._clouds.validated[: table.validated])
            ]
            batches[kind] = {name: torch.from_numpy(np.stack([pair[name] for pair in pairs])) for name in pairs[0]}
        return batches


def _answers(network: PairNetwork, batch: dict[str, Tensor]) -> np.ndarray:
    """Return the network's rotations, (P, 3, 3) float64."""
    device = next(network.parameters()).device
    found = []
    for first in range(0, len(batch["source"]), VALIDATED_AT_ONCE):
        source, target = (batch[name][first : first + VALIDATED_AT_ONCE].to(device) for name in ("source", "target"))
        found.append(network.align(source, target).T_target_source[:, :3, :3].double().cpu())
    return torch.cat(found).numpy()
