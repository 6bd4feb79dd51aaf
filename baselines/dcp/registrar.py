"""DCP-v2 as a method of regbench. Loads no torch."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from regbench.geometry.starts import Start
from regbench.learning.pair_registrar import PairRegistrar
from regbench.learning.weight_files import WeightFiles

if TYPE_CHECKING:
    from .network import SoftMatchingNetwork


class Dcp(PairRegistrar):
    """Registration by soft matches of features that attend to both clouds (DCP-v2, Wang and Solomon, ICCV 2019).

    Ours departs from the paper: LayerNorm after the maximum over neighbours stands for BatchNorm before it; our
    weights are narrower than 512 channels, and were trained with a loss of the matches besides that of the motion
    (their card says both).

    Args:
        weights: Name of the weights in this package, or a path that ends in .safetensors; "default": "modelnet40".
        init: The motion that the source is moved by first: "centroid", "identity", or "prior", the protocol's mean
            rotation. A start given by the problem replaces the first two.
        max_points: Points of each cloud that the network sees, at most; of larger clouds so many are drawn at random.
        iterations: Runs of the whole network, each beginning where the one before ended; the paper's is 1.
    """

    name = "dcp"
    files: ClassVar[WeightFiles] = WeightFiles("dcp", Path(__file__).parent / "weights", default="modelnet40")
    presets: ClassVar = {"paper": {"iterations": 1}}

    def __init__(
        self, *, weights: str = "default", init: Start = "centroid", max_points: int = 1024, iterations: int = 1
    ) -> None:
        self.weights = weights
        self.init = init
        self.max_points = max_points
        self.iterations = iterations

    def build(self, configuration: Mapping[str, Any]) -> SoftMatchingNetwork:
        """Return the network that a model card describes: DCP-v1's, of imported weights, or DCP-v2's."""
        from .network import DcpNetwork
        from .original import DcpV1Network

        arguments = dict(configuration)
        return DcpV1Network(**arguments) if arguments.pop("version", 2) == 1 else DcpNetwork(**arguments)

    def options(self) -> dict[str, Any]:
        """Return the iterations."""
        return {"iterations": self.iterations}
