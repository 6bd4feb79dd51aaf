"""What RPM-Net brings to `regbench train rpmnet`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, cast

from pydantic import Field
from torch import Tensor, nn

from regbench.learning.training.pair_trainable import PairSettings, PairTrainable

from .losses import training_losses
from .network import RpmNet


class Settings(PairSettings):
    """The [method] table of a recipe.

    Attributes:
        iterations: Of a training pair.
        inlier_weight: Of the loss that pushes matches up.
        radius: As `RpmNet`'s.
        neighbours: As `RpmNet`'s.
        normal_neighbours: As `RpmNet`'s.
    """

    iterations: int = Field(2, ge=1)
    inlier_weight: float = Field(0.01, ge=0)
    radius: float = Field(0.3, gt=0)
    neighbours: int = Field(24, ge=1)
    normal_neighbours: int = Field(24, ge=3)


class RpmNetTraining(PairTrainable):
    """Learns from the true motions."""

    name = "rpmnet"
    supervision = "supervised"
    settings_class = Settings
    recipes: ClassVar[Path | None] = Path(__file__).parent / "weights"
    default_recipe: ClassVar[str | None] = "modelnet40"

    def configuration(self) -> dict[str, Any]:
        """Return the arguments of `RpmNet`."""
        table = cast(Settings, self.table)
        return {name: getattr(table, name) for name in ("radius", "neighbours", "normal_neighbours")}

    def card(self) -> dict[str, Any]:
        """Return what every method's card says, and where normals come from."""
        return {**super().card(), "normals": "estimated from the points, their signs unused"}

    def network(self) -> RpmNet:
        """Return the network."""
        return RpmNet(**self.configuration())

    def losses(self, network: nn.Module, batch: dict[str, Tensor], progress: float) -> dict[str, Tensor]:
        """Return the paper's two terms."""
        table = cast(Settings, self.table)
        steps = cast(RpmNet, network).steps(batch["source"], batch["target"], table.iterations)
        return training_losses(steps, batch["source"], batch["T_target_source"], table.inlier_weight)
