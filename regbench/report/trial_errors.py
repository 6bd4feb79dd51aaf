"""The errors of single trials, with the problem each belongs to: for curves, categories and pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regbench.metrics.recall import THRESHOLDS
from regbench.metrics.samples import Samples
from regbench.report.rundata import Group, RunData
from regbench.runner.status import Status

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
    truths = run.truths[group.protocol.id, group.protocol.sha256]
    known = [(problem, trial) for (problem, _), trial in group.trials.items() if truths[problem] is not None]
    estimates = np.array([trial.T_target_source for _, trial in known], dtype=np.float64).reshape(-1, 4, 4)
    samples = Samples.of_motions(
        estimates, np.array([truths[problem] for problem, _ in known], dtype=np.float64).reshape(-1, 4, 4)
    )
    return TrialErrors(
        problems=np.array([problem for problem, _ in known], dtype=np.int64),
        answered=np.array([trial.status is Status.OK for _, trial in known], dtype=np.bool_),
        rotation_errors_deg=samples.rotation_errors_deg,
        translation_errors=samples.translation_errors,
        T_target_source=estimates,
    )
