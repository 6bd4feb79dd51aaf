"""The layers of an original implementation's state_dict, taken out one by one."""

from __future__ import annotations

import torch
from torch import Tensor

# What torch's BatchNorm adds to variances unless told otherwise.
EPSILON = 1e-5


def take_layer(state: dict[str, Tensor], convolution: str, norm: str | None = None) -> tuple[Tensor, Tensor]:
    """Take a layer out of a state_dict: a convolution of width 1, and the BatchNorm after it as a part of it.

    Args:
        state: By name; what is taken is removed.
        convolution: Name of the convolution; one without a bias has one of zeros here.
        norm: Name of its BatchNorm, which counts by its running statistics, or None.

    Returns:
        weight (out, in) and bias (out,) of a linear layer, float32.

    Raises:
        KeyError: A tensor is missing.
        ValueError: A convolution is wider than 1, or the BatchNorm has other channels.
    """
    weight = state.pop(f"{convolution}.weight")
    if weight[0, 0].numel() != 1:
        raise ValueError(f"'{convolution}.weight' is {tuple(weight.shape)}: no convolution of width 1")
    weight = weight.flatten(1).double()
    bias = state.pop(f"{convolution}.bias", torch.zeros(len(weight))).double()
    if norm is not None:
        factor, added, mean, variance = (
            state.pop(f"{norm}.{name}").double() for name in ("weight", "bias", "running_mean", "running_var")
        )
        state.pop(f"{norm}.num_batches_tracked", None)
        if len(factor) != len(weight):
            raise ValueError(f"'{norm}.weight' has {len(factor)} channels, '{convolution}.weight' {len(weight)}")
        scale = factor / (variance + EPSILON).sqrt()
        weight, bias = weight * scale[:, None], added + (bias - mean) * scale
    return weight.float(), bias.float()


def refuse_rest(state: dict[str, Tensor]) -> None:
    """Raise ValueError if tensors are left: they are of a network that is not known."""
    if state:
        raise ValueError(f"'{next(iter(state))}' belongs to no layer of it ({len(state)} such)")
