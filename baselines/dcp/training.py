"""What DCP brings to `regbench train dcp`: its network and its losses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, cast

from pydantic import Field
from torch import Tensor, nn

from regbench.learning.training.pair_trainable import PairSettings, PairTrainable

from .checkpoints import renamed_v1
from .losses import dcp_losses
from .network import DcpNetwork
from .registrar import Dcp


class Settings(PairSettings):
    """The [method] table of a recipe.

    Attributes:
        width: Channels of an embedding; the paper's 512 make a weight file of 23 MB.
        hidden: Channels inside the transformer's feed-forward layers.
        matching_weight: Of the loss of the matches (ours); the paper has the motion's alone.
    """

    width: int = Field(512, ge=4, multiple_of=4)
    hidden: int = Field(1024, ge=1)
    matching_weight: float = Field(0.0, ge=0)


class DcpTraining(PairTrainable):
    """Trains DCP-v2 on true motions."""

    name = "dcp"
    supervision = "supervised"
    settings_class = Settings
    recipes: ClassVar[Path | None] = Dcp.files.folder
    default_recipe: ClassVar[str | None] = "modelnet40"

    def configuration(self) -> dict[str, Any]:
        """Return the keyword arguments of `DcpNetwork`."""
        return {"width": self._own.width, "hidden": self._own.hidden}

    def network(self) -> DcpNetwork:
        """Return the network."""
        return DcpNetwork(**self.configuration())

    @classmethod
    def renamed(cls, state: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return our tensors of DCP-v1's; see `Trainable.renamed`."""
        return renamed_v1(state)

    def losses(self, network: nn.Module, batch: dict[str, Tensor], progress: float) -> dict[str, Tensor]:
        """Return the weighted terms; see `dcp_losses`."""
        weights = {"pose": 1.0, "matching": self._own.matching_weight}
        terms = dcp_losses(cast(DcpNetwork, network), batch)
        return {name: weight * terms[name] for name, weight in weights.items() if weight > 0}

    @property
    def _own(self) -> Settings:
        return cast(Settings, self.table)
