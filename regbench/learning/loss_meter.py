"""Averages of the loss terms since the last row of the log, and the watch over what is not finite."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from regbench.errors import UserError

TOTAL = "total"


class LossMeter:
    """Collects loss terms on their device; one transfer a row, for each would make the device wait."""

    def __init__(self) -> None:
        self._names: list[tuple[int, str]] = []
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
        total = torch.stack([term.reshape(()) for term in losses.values()]).sum()
        for name, term in {**losses, TOTAL: total}.items():
            self._names.append((step, name))
            self._values.append(term.detach().reshape(()).float())
        return total

    def flush(self, mean_over_processes: Callable[[Tensor], Tensor]) -> dict[str, float]:
        """Return the averages since the last flush, by name, the sum last.

        Raises:
            UserError: A term was not finite; the message names the first such term and its step.
        """
        if not self._values:
            return {}
        values = mean_over_processes(torch.stack(self._values)).cpu().double()
        names, self._names, self._values = self._names, [], []
        for (step, name), value in zip(names, values.tolist(), strict=True):
            if value - value != 0:  # of inf and nan alone
                raise UserError(f"the loss term '{name}' is {value} at step {step}")
        by_name: dict[str, list[float]] = {}
        for (_, name), value in zip(names, values.tolist(), strict=True):
            by_name.setdefault(name, []).append(value)
        averages = {name: sum(terms) / len(terms) for name, terms in by_name.items()}
        averages[TOTAL] = averages.pop(TOTAL)
        return averages
