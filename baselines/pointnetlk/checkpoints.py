"""The names in the checkpoints of PointNetLK's authors, and in those of PointNetLK Revisited's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from regbench.learning.checkpoint_layers import refuse_rest

PREFIX = "ptnet."
# (block, place in it) of each layer's convolution; its BatchNorm is at the next place.
ORIGINAL = (("h1", 0), ("h1", 3), ("h2", 0), ("h2", 3), ("h2", 6))
REVISITED = (("mlp1", 0), ("mlp2", 0), ("mlp3", 0))
BATCH_NORM = ("weight", "bias", "running_mean", "running_var", "num_batches_tracked")


def renamed_pointnet(state: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Return `PointNetLkNetwork`'s tensors and configuration.

    Args:
        state: With or without the prefix of the loop's class; T-nets are not known here.

    Raises:
        KeyError: A tensor is missing.
        ValueError: There are tensors of another network.
    """
    there = {name.removeprefix(PREFIX): tensor for name, tensor in state.items()}
    layers = REVISITED if "mlp1.0.weight" in there else ORIGINAL
    tensors, widths = {}, []
    for layer, (block, place) in enumerate(layers):
        convolution = there.pop(f"{block}.{place}.weight")
        tensors[f"encoder.linear.{layer}.weight"] = convolution.flatten(1)  # of width 1
        tensors[f"encoder.linear.{layer}.bias"] = there.pop(f"{block}.{place}.bias")
        for name in BATCH_NORM:
            tensors[f"encoder.norms.{layer}.{name}"] = there.pop(f"{block}.{place + 1}.{name}")
        widths.append(len(convolution))
    refuse_rest(there)
    return tensors, {"widths": widths, "normalisation": "batch"}
