"""The names in the checkpoints of DCP's authors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from regbench.learning.checkpoint_layers import refuse_rest, take_layer

EDGES = 4


def renamed_v1(state: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Return `DcpV1Network`'s tensors and configuration, of DCP-v1 with its DGCNN: BatchNorm is a part of the layers.

    Raises:
        KeyError: A tensor is missing.
        ValueError: There are tensors of another network: DCP-v2's transformer, say.
    """
    there = dict(state)
    there.pop("head.reflect", None)  # a constant
    names = [f"edges.{layer}" for layer in range(EDGES)] + ["embedding"]
    tensors = {}
    for place, name in enumerate(names, start=1):
        layer = take_layer(there, f"emb_nn.conv{place}", f"emb_nn.bn{place}")
        tensors[f"{name}.weight"], tensors[f"{name}.bias"] = layer
    refuse_rest(there)
    return tensors, {"version": 1, "width": len(tensors["embedding.weight"])}
