"""Three layers on every neighbour and the maximum over neighbours, a few points at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

# So many rows of 192 numbers stay in a core's cache: products run at twice the speed that they have from memory.
ROWS_AT_ONCE = 768


def perceptron_max(rows: Tensor, weights: Sequence[Tensor], biases: Sequence[Tensor]) -> Tensor:
    """Return max over k of W3 relu(W2 relu(W1 x + b1) + b2) + b3.

    Nothing of size (points x neighbours x channels) is kept for the backward pass: it makes the two hidden layers
    anew, piece by piece, and the last layer's gradient goes through the winners of the maximum alone.

    Args:
        rows: (B, N, k, F) float32. Receives no gradient.
        weights: W1, W2, W3, each (out, in).
        biases: b1, b2, b3.

    Returns:
        (B, N, C).
    """
    flat = rows.detach().flatten(0, 1)
    if flat.device.type != "cpu" or flat.dtype != torch.float32:
        found = _plain(flat, weights, biases)
    elif torch.is_grad_enabled():
        found = _PerceptronMax.apply(flat, *weights, *biases)  # type: ignore[no-untyped-call]  # torch's own
    else:
        memory = _Memory(flat, weights)
        pieces = memory.pieces(flat)
        found = torch.cat([memory.last(piece, weights, biases).amax(dim=1) for piece in pieces]) + biases[2]
    return found.view(*rows.shape[:2], -1)


def _plain(rows: Tensor, weights: Sequence[Tensor], biases: Sequence[Tensor]) -> Tensor:
    for weight, bias in zip(weights[:2], biases[:2], strict=True):
        rows = functional.linear(rows, weight, bias).relu()
    return functional.linear(rows, weights[2]).amax(dim=1) + biases[2]


class _Memory:
    """The layers' values of a piece of the rows. All pieces use the same memory: new memory costs more than a layer."""

    def __init__(self, rows: Tensor, weights: Sequence[Tensor]) -> None:
        self.k = rows.shape[1]
        self.points = max(1, ROWS_AT_ONCE // self.k)
        self.values = [rows.new_empty(min(self.points, len(rows)) * self.k, len(weight)) for weight in weights]

    def pieces(self, points: Tensor) -> tuple[Tensor, ...]:
        return torch.split(points, self.points)

    def hidden(self, piece: Tensor, weights: Sequence[Tensor], biases: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Return the two hidden layers, (rows, width)."""
        rows = piece.flatten(0, 1)
        first, second = (values[: len(rows)] for values in self.values[:2])
        torch.addmm(biases[0], rows, weights[0].T, out=first).relu_()
        torch.addmm(biases[1], first, weights[1].T, out=second).relu_()
        return first, second

    def last(self, piece: Tensor, weights: Sequence[Tensor], biases: Sequence[Tensor]) -> Tensor:
        """Return the last layer without its bias, (points, k, channels)."""
        _, second = self.hidden(piece, weights, biases)
        return torch.mm(second, weights[2].T, out=self.values[2][: len(second)]).view(len(piece), self.k, -1)


class _PerceptronMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor, *parameters: Tensor) -> Tensor:
        from .perceptron_max_loops import group_max

        weights, biases = parameters[:3], parameters[3:]
        memory = _Memory(rows, weights)
        maximum = rows.new_empty(len(rows), len(weights[2]))
        winners = torch.empty(maximum.shape, dtype=torch.int32)
        for piece, highest, winner in zip(*(memory.pieces(each) for each in (rows, maximum, winners)), strict=True):
            group_max(memory.last(piece, weights, biases).numpy(), highest.numpy(), winner.numpy())
        ctx.save_for_backward(rows, winners, *parameters)
        return maximum + biases[2]

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        from .perceptron_max_loops import group_max_backward, relu_backward

        rows, winners, *parameters = ctx.saved_tensors
        (gradient,) = (each.contiguous() for each in gradients)
        weights, biases = parameters[:3], parameters[3:]
        W1, W2, W3 = (torch.zeros_like(each) for each in weights)
        b1, b2 = (torch.zeros_like(each) for each in biases[:2])
        memory, of_hidden = _Memory(rows, weights), _Memory(rows, weights)
        for piece, g, winner in zip(*(memory.pieces(each) for each in (rows, gradient, winners)), strict=True):
            first, second = memory.hidden(piece, weights, biases)
            of_first, of_second = (values[: len(first)] for values in of_hidden.values[:2])
            group_max_backward(
                g.numpy(), winner.numpy(), weights[2].numpy(), second.numpy(), of_second.numpy(), W3.numpy()
            )
            W2.addmm_(of_second.T, first)
            b2 += of_second.sum(dim=0)
            torch.mm(of_second, weights[1], out=of_first)
            relu_backward(of_first.numpy(), first.numpy())
            W1.addmm_(of_first.T, piece.flatten(0, 1))
            b1 += of_first.sum(dim=0)
        return None, W1, W2, W3, b1, b2, gradient.sum(dim=0)
