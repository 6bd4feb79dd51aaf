"""IDAM as a method of regbench. Loads no torch."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from regbench.geometry.starts import Start
from regbench.learning.pair_registrar import PairRegistrar
from regbench.learning.weight_files import WeightFiles

if TYPE_CHECKING:
    from .network import IdamNetwork


class Idam(PairRegistrar):
    """Registration by matches of a learned similarity matrix (IDAM, Li et al., ECCV 2020), the GNN variant.

    Ours departs from the paper: LayerNorm after the maximum over neighbours stands for BatchNorm before it, and there
    is none on pairs; the features of our weights are also made from distances and radii that no rotation changes (the
    weights' card says "geometry"); and of the target every point may be matched, not the most significant sixth.

    Args:
        weights: Name of the weights in this package ("modelnet40"; "partial": for clouds that overlap in part), or a
            path that ends in .safetensors; "default": "modelnet40".
        init: The motion that the source is moved by first: "centroid", "identity", or "prior", the protocol's mean
            rotation. A start given by the problem replaces the first two.
        max_points: Points of each cloud that the network sees, at most; of larger clouds so many are drawn at random.
        iterations: Of matching and alignment; those beyond the three trained ones repeat the third. On held-out shapes
            ten are better than the paper's three on noise and crops (docs/learned_baselines.md).
        source_share: Share of the source's points, the most significant, that are matched; 64 points at least.
        target_share: The same of the target, that they are matched to.
    """

    name = "idam"
    files: ClassVar[WeightFiles] = WeightFiles("idam", Path(__file__).parent / "weights", default="modelnet40")
    presets: ClassVar = {"paper": {"iterations": 3, "source_share": 1 / 6, "target_share": 1 / 6}}

    def __init__(
        self,
        *,
        weights: str = "default",
        init: Start = "centroid",
        max_points: int = 1024,
        iterations: int = 10,
        source_share: float = 1 / 6,
        target_share: float = 1.0,
    ) -> None:
        self.weights = weights
        self.init = init
        self.max_points = max_points
        self.iterations = iterations
        self.source_share = source_share
        self.target_share = target_share

    def build(self, configuration: Mapping[str, Any]) -> IdamNetwork:
        """Return the network that a model card describes: by the authors' layers, of imported weights, or by ours."""
        from .network import IdamNetwork
        from .original import OriginalIdam

        arguments = dict(configuration)
        return OriginalIdam(**arguments) if arguments.pop("layers_of", None) == "authors" else IdamNetwork(**arguments)

    def options(self) -> dict[str, Any]:
        """Return iterations and shares."""
        return {
            "iterations": self.iterations,
            "source_share": self.source_share,
            "target_share": self.target_share,
        }
