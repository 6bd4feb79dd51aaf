"""What PointNetLK brings to `regbench train pointnetlk`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import torch
from pydantic import Field
from torch import Tensor, nn

from regbench.learning.layers.lucas_kanade import lucas_kanade, pose_loss
from regbench.learning.layers.pointnet import update_statistics
from regbench.learning.training.pair_trainable import PairSettings, PairTrainable

from .checkpoints import renamed_pointnet
from .network import WIDTHS, PointNetLkNetwork
from .registrar import FILES


class EncoderSettings(PairSettings):
    """What PointNetLK and FMR have in common.

    Attributes:
        widths: Of the PointNet's layers.
        normalisation: Of each layer.
        iterations: Of the loop that the pose loss goes through.
    """

    widths: list[int] = Field(list(WIDTHS), min_length=1)
    normalisation: Literal["batch", "none"] = "batch"
    iterations: int = Field(10, ge=1)

    def configuration(self) -> dict[str, Any]:
        """Return the network's arguments."""
        return {"widths": self.widths, "normalisation": self.normalisation}


class Settings(EncoderSettings):
    """The [method] table of a recipe.

    Attributes:
        each: Whether every iteration's motion is in the loss, not the last alone.
        robust: Whether log(1 + .) of a pair's pose loss is minimised: the gradient through a loop that went astray is
            as large as it is meaningless.
        feature_weight: Of the feature residual.
    """

    each: bool = False
    robust: bool = False
    feature_weight: float = Field(1.0, ge=0)


class PointNetLkTraining(PairTrainable):
    """Trains on true motions, through the loop (Aoki et al. 2019)."""

    name = "pointnetlk"
    supervision = "supervised"
    recipes: ClassVar[Path | None] = FILES.folder
    default_recipe: ClassVar[str | None] = "modelnet40"
    settings_class = Settings

    def configuration(self) -> dict[str, Any]:
        """Return the network's arguments."""
        return cast(Settings, self.table).configuration()

    def network(self) -> PointNetLkNetwork:
        """Return the network."""
        return PointNetLkNetwork(**self.configuration())

    @classmethod
    def renamed(cls, state: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return our tensors of PointNetLK's or PointNetLK Revisited's; see `Trainable.renamed`."""
        return renamed_pointnet(state)

    def losses(self, network: nn.Module, batch: dict[str, Tensor], progress: float) -> dict[str, Tensor]:
        """Return the mean of |G G_true^-1 - I|^2 and the mean square of the last feature residual."""
        table, encoder = cast(Settings, self.table), cast(PointNetLkNetwork, network).encoder
        source, target = batch["source"], batch["target"]
        if table.normalisation == "batch":
            update_statistics(encoder, torch.cat([source, target]))
        visited, residual = lucas_kanade(encoder.folded(), source, target, iterations=table.iterations)
        motions = torch.stack(visited if table.each else visited[-1:])
        pose = pose_loss(motions, batch["T_target_source"])
        return {
            "pose": (pose.log1p() if table.robust else pose).mean(),
            "feature": table.feature_weight * residual.square().mean(),
        }
