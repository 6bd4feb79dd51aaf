"""The names in the checkpoints of IDAM's authors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from regbench.learning.checkpoint_layers import refuse_rest, take_layer

GRAPH_LAYERS = 5
# Their blocks by ours, in the order of a similarity convolution: (block, place in it, whether BatchNorm follows, ours).
SIMILARITY = (
    ("sim_mat_conv1", 0, True, "pair"),
    ("sim_mat_conv1", 1, False, "hidden"),
    ("sim_mat_conv2", 0, True, "score.0"),
    ("sim_mat_conv2", 1, False, "score.2"),
    ("weight_fc", 0, True, "validity.0"),
    ("weight_fc", 1, False, "validity.2"),
)


def renamed_original(state: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Return `OriginalIdam`'s tensors and configuration, of IDAM with its graph network ("GNN").

    BatchNorm is a part of the layers.

    Raises:
        KeyError: A tensor is missing: of the variant on FPFH features, say.
        ValueError: There are tensors of another network.
    """
    there = dict(state)
    there.pop("head.reflect", None)  # a constant
    tensors: dict[str, Tensor] = {}

    def take(theirs: str, normed: bool, ours: str) -> None:
        names = (f"{theirs}.conv", f"{theirs}.bn") if normed else (theirs, None)
        tensors[f"{ours}.weight"], tensors[f"{ours}.bias"] = take_layer(there, *names)

    for layer in range(GRAPH_LAYERS):
        block = f"emb_nn.propogate{layer + 1}"  # their spelling
        take(f"{block}.conv2d.conv.0", True, f"points.layers.{layer}.first")
        take(f"{block}.conv2d.conv.1", False, f"points.layers.{layer}.second")
        take(f"{block}.conv1d.conv.0", False, f"points.layers.{layer}.point")
    for place in range(3):
        take(f"significance_fc.conv.{place}", place < 2, f"significance.{2 * place}")
    iterations = 0
    while f"sim_mat_conv1.{iterations}.conv.1.weight" in there:
        for theirs, place, normed, ours in SIMILARITY:
            take(f"{theirs}.{iterations}.conv.{place}", normed, f"similarities.{iterations}.{ours}")
        iterations += 1
    refuse_rest(there)
    width, pair_width = len(tensors["points.layers.4.point.weight"]), len(tensors["similarities.0.pair.weight"])
    return tensors, {"layers_of": "authors", "width": width, "pair_width": pair_width, "iterations": iterations}
