"""PointNetLK as a method."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from regbench.geometry.starts import Start
from regbench.learning.pair_registrar import PairRegistrar
from regbench.learning.weight_files import WeightFiles

if TYPE_CHECKING:
    from .network import PointNetLkNetwork

FILES = WeightFiles("pointnetlk", Path(__file__).parent / "weights", default="modelnet40")


class PointNetLk(PairRegistrar):
    """PointNetLK (Aoki et al. 2019): the source is moved until its PointNet feature is the target's.

    Ours has the analytical Jacobian of PointNetLK Revisited (Li et al. 2021), which six more passes of the network only
    approximate; takes back updates that make the features' difference larger; goes on until the motion settles; and
    starts twice: from no rotation, and from the mean rotation of the motions that it was trained on. The `confidence`
    is minus the root mean square of the features' difference.

    Args:
        weights: Name of the weights in this package, or a path that ends in .safetensors.
        init: The motion that the source is moved by first: "centroid", "identity", or "prior", the protocol's mean
            rotation. A start given by the problem replaces the first two.
        iterations: Most updates.
        jacobian: "analytical" or "numerical".
        step: Twists of "numerical", rad and extents of the target.
        from_mean: Whether it starts a second time, from that mean; of the two ends the one whose features are nearer to
            the target's is the answer.
        descent: Whether updates that make the features' difference larger are taken back.
        tolerance: Stop where no component of an update is larger, rad and extents of the target.
        max_points: Points of each cloud that the network sees, at most; of larger clouds so many are drawn.
    """

    name = "pointnetlk"
    files: ClassVar[WeightFiles] = FILES
    presets: ClassVar = {
        "paper": {
            "iterations": 10,
            "jacobian": "numerical",
            "step": 1e-2,
            "descent": False,
            "from_mean": False,
            "tolerance": 1e-7,
        }
    }

    def __init__(
        self,
        *,
        weights: str = "default",
        init: Start = "centroid",
        iterations: int = 30,
        jacobian: Literal["analytical", "numerical"] = "analytical",
        step: float = 1e-2,
        from_mean: bool = True,
        descent: bool = True,
        tolerance: float = 1e-5,
        max_points: int = 5000,
    ) -> None:
        self.weights = weights
        self.init = init
        self.iterations = iterations
        self.jacobian = jacobian
        self.step = step
        self.from_mean = from_mean
        self.descent = descent
        self.tolerance = tolerance
        self.max_points = max_points

    def build(self, configuration: Mapping[str, Any]) -> PointNetLkNetwork:
        """Return the network of a model card."""
        from .network import PointNetLkNetwork

        return PointNetLkNetwork(**configuration)

    def options(self) -> dict[str, Any]:
        """Return how the loop runs."""
        return {
            "iterations": self.iterations,
            "jacobian": self.jacobian,
            "step": self.step,
            "from_mean": self.from_mean,
            "descent": self.descent,
            "tolerance": self.tolerance,
        }
