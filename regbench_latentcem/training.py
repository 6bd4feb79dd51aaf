"""What LatentCEM brings to `regbench train latentcem`: clouds, networks, loss, validation."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field, model_validator
from torch import Tensor, nn

from regbench.learning.training.clouds import DatasetName, TrainingClouds
from regbench.learning.training.recipe import read_table
from regbench.learning.training.trainable import Sample, Trainable

from .encoder import POINTS
from .losses import training_losses
from .model import Configuration, LatentModel
from .sampling import Sampling, draw_sample
from .support import extreme_points, start_as_support, support_states, support_transformation_loss
from .validation import ValidationPairs
from .weight_files import FOLDER


class Settings(BaseModel):
    """The [method] table of a recipe.

    Attributes:
        dataset: "modelnet40" (its training split) or "7scenes" (the protocol's 296 training scans).
        held_out: Clouds of them that training never sees: validation.
        validated: How many of those are validated each time.
        points: Points of a cloud.
        start: "support": the encoder starts as a support function, and f and d learn on it first (support.py);
            "random".
        alone_share: The first part of the training, with start = "support", in which f learns alone, under the
            recipe's precision: a step of it is cheap. Everything else is in full precision.
        support_share: The part of the training in which they do.
        support_clouds: Clouds in a step of that part that f learns from, besides the batch.
        support_copies: Motions of each of them.
        copies: Moved copies of a cloud in a sample (see sampling.py).
        noisy: Share of noisy samples.
        varied: Whether clouds are stretched, turned and mirrored at random: where there are few.
        decoded: Clouds in a step that the reconstruction is taken from.
        reconstruction_weight: Of Eq. 4.
        transformation_weight: Of Eq. 6.
        evaluation_weight: Of Eq. 7 and of its form on f's predictions. Its squares of distances under 1 are small.
        evaluation_rate: Learning rate of d, as a factor on the recipe's; with start = "support".
        encoder: As `Configuration`'s.
        decoder: As `Configuration`'s.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    dataset: DatasetName = "modelnet40"
    held_out: int = Field(300, ge=1)
    validated: int = Field(64, ge=1)
    points: int = Field(POINTS, ge=32)
    start: Literal["support", "random"] = "support"
    alone_share: float = Field(0.5, ge=0, le=1)
    support_share: float = Field(0.75, ge=0, le=1)
    support_clouds: int = Field(48, ge=1)
    support_copies: int = Field(6, ge=1)
    copies: int = Field(3, ge=2)
    noisy: float = Field(0.5, ge=0, le=1)
    varied: bool = False
    decoded: int = Field(1, ge=1)
    reconstruction_weight: float = Field(1.0, ge=0)
    transformation_weight: float = Field(1.0, ge=0)
    evaluation_weight: float = Field(30.0, ge=0)
    evaluation_rate: float = Field(0.002, gt=0)
    encoder: Literal["dgcnn", "folding"] = "dgcnn"
    decoder: Literal["folding", "mlp"] = "folding"

    @model_validator(mode="after")
    def _can_start(self) -> Settings:
        if self.start == "support" and self.encoder != "dgcnn":
            raise ValueError('start = "support" needs encoder = "dgcnn"; FoldingNet\'s starts with "random"')
        return self


class LatentCemTraining(Trainable):
    """Trains the paper's four networks on self-made motions of clouds, without labels."""

    name = "latentcem"
    monitor = "median_rotation_error_deg"
    recipes: ClassVar[Path | None] = FOLDER
    default_recipe: ClassVar[str | None] = "modelnet40"

    def __init__(self, settings: Mapping[str, Any], *, data: Path) -> None:
        super().__init__(settings, data=data)
        self.table = read_table(Settings, settings, "latentcem: [method]")
        self.settings = self.table.model_dump()
        self.configuration = Configuration(encoder=self.table.encoder, decoder=self.table.decoder)

    def network(self) -> LatentModel:
        """Return the four networks."""
        model = LatentModel(self.configuration)
        if self.table.start == "support":
            start_as_support(model)
        return model

    def sample(self, rng: np.random.Generator, progress: float) -> Sample:
        """Return a training cloud's sample."""
        trained = self._clouds.trained
        cloud = self._clouds.cloud(int(trained[rng.integers(len(trained))]))
        sampling = Sampling(copies=self.table.copies, noisy=self.table.noisy, varied=self.table.varied)
        return cast(Sample, draw_sample(cloud, self.table.points, sampling, rng))

    def losses(self, network: nn.Module, batch: dict[str, Tensor], progress: float) -> dict[str, Tensor]:
        """Return the weighted terms of Eq. 8."""
        model = cast(LatentModel, network)
        with_support = self.table.start == "support"
        if with_support and progress < self.table.alone_share:
            terms = {"transformation": self._loss_on_support(model, batch)}
        else:
            # Graphs and Chamfer distances need their digits.
            with torch.autocast(batch["source"].device.type, enabled=False):
                if with_support and progress < self.table.support_share:
                    terms = self._losses_on_support(model, batch)
                else:
                    terms = training_losses(model, batch, decoded=self.table.decoded)
        weights = {
            "reconstruction": self.table.reconstruction_weight,
            "transformation": self.table.transformation_weight,
            "evaluation": self.table.evaluation_weight,
            "prediction": self.table.evaluation_weight,
        }
        return {name: weights[name] * term for name, term in terms.items()}

    def validate(self, network: nn.Module) -> dict[str, float]:
        """Return the planner's errors on held-out clouds, and the R^2 of what it is told."""
        return self._pairs.figures(cast(LatentModel, network))

    def tensors(self, network: nn.Module) -> dict[str, Tensor]:
        """Return what registration needs: all but the decoder, with which a file would be over 8 MB."""
        return {name: tensor for name, tensor in network.state_dict().items() if not name.startswith("decoder.")}

    def load(self, network: nn.Module, weights: Any) -> None:
        """Copy weights into the networks; the decoder, which weight files leave out, starts anew."""
        weights.load_into(cast(LatentModel, network).without_decoder())

    def learning_rate_factors(self, network: nn.Module) -> dict[str, float]:
        """Return a lower rate for d where it starts as a measure of z' - z.

        Trained faster it predicts distances better and the planner's answers get worse: at a factor of 0.15 its median
        error doubled in 1000 steps.
        """
        return {"evaluation.": self.table.evaluation_rate} if self.table.start == "support" else {}

    def card(self) -> dict[str, Any]:
        """Return data, split and configuration."""
        return {
            "method": "latentcem",
            "model": "paper",
            "supervision": "unsupervised",
            "configuration": self.configuration.as_card(),
            "data": self._clouds.card(),
        }

    def _losses_on_support(self, model: LatentModel, batch: dict[str, Tensor]) -> dict[str, Tensor]:
        """Return the terms of f and d; the encoder, whose states are given, has none, and the decoder waits for it."""
        clouds = torch.cat([batch["source"][:, None], batch["copies"]], dim=1)
        states = support_states(clouds.flatten(0, 1)).view(*clouds.shape[:2], -1)
        return {
            **training_losses(model, batch, decoded=0, states=states),
            "transformation": self._loss_on_support(model, batch),
        }

    def _loss_on_support(self, model: LatentModel, batch: dict[str, Tensor]) -> Tensor:
        return support_transformation_loss(
            model,
            self._extremes_on(batch["source"].device),
            clouds=self.table.support_clouds,
            copies=self.table.support_copies,
            noisy=self.table.noisy,
            varied=self.table.varied,
        )

    @cached_property
    def _extremes(self) -> Tensor:
        return extreme_points(self._clouds.cloud(int(index)) for index in self._clouds.trained)

    def _extremes_on(self, device: torch.device) -> Tensor:
        """Return the extreme points on a device; they are copied there once."""
        if self._extremes.device != device:
            self._extremes = self._extremes.to(device)
        return self._extremes

    @cached_property
    def _clouds(self) -> TrainingClouds:
        table = self.table
        most = max(POINTS, table.points)
        return TrainingClouds(table.dataset, self.data, most, table.held_out, "latentcem: [method]")

    @cached_property
    def _pairs(self) -> ValidationPairs:
        held_out = self._clouds.validated[: self.table.validated]
        clouds = [self._clouds.cloud(int(index)) for index in held_out]
        return ValidationPairs.of(clouds, self.table.points)
