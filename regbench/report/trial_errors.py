"""The errors of single trials, with the problem each belongs to: for curves, categories and pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regbench.metrics.recall import THRESHOLDS
from regbench.metrics.samples import Samples
from regbench.report.rundata import Group, RunData

Array = NDArray[np.float64]

# A length stands beside an angle as in the tables' thresholds: 0.01 beside 1 deg, 0.05 beside 5 deg.
DEG_PER_LENGTH = THRESHOLDS["5deg"][0] / THRESHOLDS["5deg"][1]


@dataclass(frozen=True, eq=False)
class TrialErrors:
    """The trials of one method on one protocol whose ground truth is known, in the order of problem and repeat.

    Attributes:
        problems: (n,) numbers of the problems.
        answered: (n,) False where the trial failed, and was scored as the identity.
        rotation_errors_deg: (n,) isotropic.
        translation_errors: (n,) isotropic, in the clouds' unit.
        T_target_source: (n, 4, 4) answers.
    """

    problems: NDArray[np.int64]
    answered: NDArray[np.bool_]
    rotation_errors_deg: Array
    translation_errors: Array
    T_target_source: Array

    @property
    def misses_deg(self) -> Array:
        """(n,) the greater of both errors, the length counted as DEG_PER_LENGTH degrees: what recall goes by."""
        misses: Array = np.maximum(self.rotation_errors_deg, self.translation_errors * DEG_PER_LENGTH)
        return misses


def trial_errors(group: Group, run: RunData) -> TrialErrors:
    """Return the errors of one method on one protocol, a failed trial scored as the identity."""
    trials = group.trials
    truths = run.truths[group.protocol.id, group.protocol.sha256].of(trials.problems)
    known = ~np.isnan(truths[:, 0, 0])
    samples = Samples.of_motions(trials.T_target_source[known], truths[known])
    return TrialErrors(
        problems=trials.problems[known],
        answered=trials.answered[known],
        rotation_errors_deg=samples.rotation_errors_deg,
        translation_errors=samples.translation_errors,
        T_target_source=trials.T_target_source[known],
    )
