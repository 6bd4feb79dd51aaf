"""RPM-Net as a method of regbench."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from regbench.geometry.starts import Start
from regbench.learning.pair_registrar import PairRegistrar
from regbench.learning.weight_files import WeightFiles

if TYPE_CHECKING:
    from .network import RpmNet


class RpmNetRegistrar(PairRegistrar):
    """Registration by soft matches of learned features (Yew and Lee, CVPR 2020).

    Ours departs from the paper: normals are estimated from the points, so angles of point pair features are those
    between lines; a point's neighbours are the nearest within the radius, not any, and fewer than 64 (the weights
    say); and the features have layer normalisation after the maximum over neighbours, none before it, in place of
    group normalisation.

    Args:
        weights: Name of the weights in this package ("modelnet40"; "partial": for clouds that overlap in part), or a
            path that ends in .safetensors; "default": "modelnet40".
        init: The motion that the source is moved by first: "centroid", "identity", or "prior", the protocol's mean
            rotation. A start given by the problem replaces the first two.
        max_points: Points of each cloud that the network sees, at most; of larger clouds so many are drawn at random.
        iterations: Of matching and alignment.
    """

    name = "rpmnet"
    files: ClassVar[WeightFiles] = WeightFiles("rpmnet", Path(__file__).parent / "weights", default="modelnet40")
    presets: ClassVar = {"paper": {"iterations": 5}}

    def __init__(
        self, *, weights: str = "default", init: Start = "centroid", max_points: int = 2048, iterations: int = 5
    ) -> None:
        self.weights = weights
        self.init = init
        self.max_points = max_points
        self.iterations = iterations

    def build(self, configuration: Mapping[str, Any]) -> RpmNet:
        """Return the network that a model card describes."""
        from .network import RpmNet

        return RpmNet(**configuration)

    def options(self) -> dict[str, Any]:
        """Return the iterations."""
        return {"iterations": self.iterations}
