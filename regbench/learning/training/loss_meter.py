"""Averages of the loss terms since the last row of the log, and the watch over what is not finite."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from regbench.errors import UserError

TOTAL = "total"


class LossMeter:
    """Collects loss terms on their device; one transfer a row, for each would make the device wait."""

    def __init__(self) -> None:
        self._steps: list[tuple[int, tuple[str, ...]]] = []
        self._values: list[Tensor] = []

    def add(self, step: int, losses: Mapping[str, Tensor]) -> Tensor:
        """Remember the terms of a step, the `step`-th counted from 1, and return their sum.

        Raises:
            UserError: There is no term, one is not a scalar, or one is called "total".
        """
        for name, term in losses.items():
            if term.numel() != 1 or name == TOTAL:
                what = "a name kept for the sum" if name == TOTAL else f"of shape {list(term.shape)}, not a scalar"
                raise UserError(f"losses(): the term '{name}' is {what}")
        if not losses:
            raise UserError("losses(): there is no term to minimise")
        values = torch.stack([term.reshape(()) for term in losses.values()])
        self._steps.append((step, tuple(losses)))
        self._values.append(values.detach())
        return values.sum()

    def flush(self, mean_over_processes: Callable[[Tensor], Tensor]) -> dict[str, float]:
        """Return the averages since the last flush by name, and that of the sums; a term may be absent from a step.

        Raises:
            UserError: A term was not finite; the message names the first such term and its step.
        """
        if not self._values:
            return {}
        values = iter(mean_over_processes(torch.cat(self._values).float()).tolist())
        steps, self._steps, self._values = self._steps, [], []
        by_name: dict[str, list[float]] = {}
        totals = []
        for step, names in steps:
            terms = {name: next(values) for name in names}
            for name, value in terms.items():
                if not math.isfinite(value):
                    raise UserError(f"the loss term '{name}' is {value} at step {step}")
                by_name.setdefault(name, []).append(value)
            totals.append(sum(terms.values()))
        averages = {name: sum(terms) / len(terms) for name, terms in by_name.items()}
        return averages | {TOTAL: sum(totals) / len(totals)}
