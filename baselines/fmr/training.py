"""What FMR brings to `regbench train fmr`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import torch
from pydantic import Field
from torch import Tensor, nn

from regbench.learning.layers.chamfer import chamfer_distance
from regbench.learning.layers.lucas_kanade import lucas_kanade, pose_loss
from regbench.learning.layers.pointnet import pooled, update_statistics
from regbench.learning.training.pair_trainable import PairTrainable
from regbench.learning.weights import Weights

from ..pointnetlk.network import PointNetLkNetwork
from ..pointnetlk.training import EncoderSettings
from .network import FmrNetwork
from .registrar import FILES


class Settings(EncoderSettings):
    """The [method] table of a recipe.

    Attributes:
        decoded_points: Of the decoder.
        pose_weight: Of the pose loss: 0 is FMR's unsupervised training, more its semi-supervised one.
    """

    decoded_points: int = Field(784, ge=1)
    pose_weight: float = Field(0.0, ge=0)


class FmrTraining(PairTrainable):
    """Trains encoder and decoder to rebuild both clouds of a pair (Huang et al. 2020), without their motion."""

    name = "fmr"
    recipes: ClassVar[Path | None] = FILES.folder
    default_recipe: ClassVar[str | None] = "modelnet40"
    settings_class = Settings

    @property
    def supervision(self) -> Literal["supervised", "unsupervised"]:  # type: ignore[override]  # the recipe decides
        """Whether the true motions are used."""
        return "supervised" if cast(Settings, self.table).pose_weight else "unsupervised"

    def configuration(self) -> dict[str, Any]:
        """Return the arguments of the network without its decoder."""
        return cast(Settings, self.table).configuration()

    def network(self) -> FmrNetwork:
        """Return the network with its decoder."""
        return FmrNetwork(cast(Settings, self.table).decoded_points, **self.configuration())

    def losses(self, network: nn.Module, batch: dict[str, Tensor], progress: float) -> dict[str, Tensor]:
        """Return the Chamfer distances of both clouds to what is rebuilt of them; and the pose loss, if it counts."""
        table, model = cast(Settings, self.table), cast(FmrNetwork, network)
        clouds = torch.cat([batch["source"], batch["target"]])
        if table.normalisation == "batch":
            update_statistics(model.encoder, clouds)
        layers = model.encoder.folded()
        losses = {"chamfer": chamfer_distance(model.rebuilt(pooled(layers, clouds)), clouds).mean()}
        if table.pose_weight:
            visited, _ = lucas_kanade(layers, batch["source"], batch["target"], iterations=table.iterations)
            losses["pose"] = table.pose_weight * pose_loss(visited[-1], batch["T_target_source"]).mean()
        return losses

    def tensors(self, network: nn.Module) -> dict[str, Tensor]:
        """Return what registration needs: the encoder."""
        return {name: tensor for name, tensor in network.state_dict().items() if not name.startswith("decoder.")}

    def load(self, network: nn.Module, weights: Weights) -> None:
        """Copy an encoder's weights; the decoder starts anew."""
        without = PointNetLkNetwork(**self.configuration())
        weights.load_into(without)
        cast(FmrNetwork, network).encoder.load_state_dict(without.encoder.state_dict())
