"""What IDAM brings to `regbench train idam`: its network and its losses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, cast

from pydantic import Field
from torch import Tensor, nn

from regbench.learning.training.pair_trainable import PairSettings, PairTrainable

from .checkpoints import renamed_original
from .features import Geometry
from .losses import idam_losses
from .network import IdamNetwork
from .registrar import Idam


class Settings(PairSettings):
    """The [method] table of a recipe.

    Attributes:
        geometry: What the features are made from, see `PointFeatures`.
        compared: Whether pairs have the difference of their features, see `SimilarityConvolution`.
        source_share: Share of the source's points that a loss is taken from.
        target_share: The same of the target; the paper's is a sixth of both.
        radius: Within which a target point is a source point's partner, in extents of the target.
        significance_weight: Of the loss of the significance.
        validity_weight: Of that of the validity.
    """

    geometry: Geometry = "xyz"
    compared: bool = False
    source_share: float = Field(1 / 6, gt=0, le=1)
    target_share: float = Field(1 / 6, gt=0, le=1)
    radius: float = Field(0.05, gt=0)
    significance_weight: float = Field(1.0, ge=0)
    validity_weight: float = Field(1.0, ge=0)


class IdamTraining(PairTrainable):
    """Trains IDAM on the true matches of self-made pairs."""

    name = "idam"
    supervision = "supervised"
    settings_class = Settings
    recipes: ClassVar[Path | None] = Idam.files.folder
    default_recipe: ClassVar[str | None] = "modelnet40"

    def configuration(self) -> dict[str, Any]:
        """Return the keyword arguments of `IdamNetwork`."""
        return {"geometry": self._own.geometry, "compared": self._own.compared}

    def network(self) -> IdamNetwork:
        """Return the network."""
        return IdamNetwork(**self.configuration())

    @classmethod
    def renamed(cls, state: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return our tensors of the authors'; see `Trainable.renamed`."""
        return renamed_original(state)

    def losses(self, network: nn.Module, batch: dict[str, Tensor], progress: float) -> dict[str, Tensor]:
        """Return the weighted terms; see `idam_losses`."""
        table = self._own
        terms = idam_losses(
            cast(IdamNetwork, network),
            batch,
            source_share=table.source_share,
            target_share=table.target_share,
            radius=table.radius,
        )
        weights = {
            "matching": 1.0,
            "significance": table.significance_weight,
            "validity": table.validity_weight,
        }
        return {name: weights[name] * term for name, term in terms.items()}

    @property
    def _own(self) -> Settings:
        return cast(Settings, self.table)
