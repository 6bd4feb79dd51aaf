"""Which pairs to look at: a method's worst, its median and its best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from regbench.report.trial_errors import TrialErrors

Kind = Literal["worst", "median", "best"]


@dataclass(frozen=True)
class Pick:
    """A pair that was picked.

    Attributes:
        kind: Why.
        rank: 1 for the very worst, the median itself, the very best.
        trial: Its position in the errors.
    """

    kind: Kind
    rank: int
    trial: int


def pick(errors: TrialErrors, *, worst: int, median: int, best: int) -> list[Pick]:
    """Return up to so many pairs of each kind: worst first, then median, then best. A short run's may be of two kinds.

    Trials are ordered by `misses_deg`, then by problem. Only those that answered are picked: of a failed trial there
    is nothing to see. Of several repeats of a problem the first that answered stands for it.
    """
    answered = np.flatnonzero(errors.answered)
    _, first = np.unique(errors.problems[answered], return_index=True)
    trials = answered[first]
    order = trials[np.lexsort((errors.problems[trials], errors.misses_deg[trials]))].tolist()
    from_the_middle = sorted(range(len(order)), key=lambda position: abs(2 * position - len(order) + 1))
    by_kind: dict[Kind, list[int]] = {
        "worst": order[::-1][:worst],
        "median": [order[position] for position in from_the_middle[:median]],
        "best": order[:best],
    }
    return [Pick(kind, rank, trial) for kind, found in by_kind.items() for rank, trial in enumerate(found, start=1)]
