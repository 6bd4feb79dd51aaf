"""Whether one method is worse than another on the same trials, trial by trial."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def signed_rank_p(worse: Array, better: Array, *, higher_is_better: bool) -> float:
    """Return the one-sided p of Wilcoxon's signed-rank test (1945) that the first values are worse than the second.

    SciPy's, by the normal approximation with its correction for ties. Trials on which both are equal are left out, as
    Wilcoxon did; where all are, p is 1.

    Args:
        worse: (n,) of the method that is suspected to be worse.
        better: (n,) of the other, on the same trials.
        higher_is_better: What better means.
    """
    from scipy.stats import wilcoxon  # half a second to import

    differences = (better - worse) if higher_is_better else (worse - better)
    differences = differences[differences != 0]
    if not differences.size:
        return 1.0
    # The types that scipy-stubs has know the method's older name, "approx", alone.
    return float(wilcoxon(differences, alternative="greater", method="asymptotic").pvalue)  # type: ignore[call-overload]


def holm(p: Sequence[float]) -> list[float]:
    """Return p values that are corrected for their number (Holm 1979): the k-th smallest of m times m - k + 1."""
    order = np.argsort(p, kind="stable")
    factors = len(p) - np.arange(len(p))
    corrected = np.minimum(np.maximum.accumulate(np.asarray(p, dtype=np.float64)[order] * factors), 1.0)
    result = np.empty(len(p))
    result[order] = corrected
    return [float(value) for value in result]


def probability_of_improvement(first: Array, second: Array, *, higher_is_better: bool) -> float:
    """Return the share of trials on which the second is better, equal ones counted half; NaN for n = 0.

    Args:
        first: (n,).
        second: (n,), on the same trials.
        higher_is_better: What better means.
    """
    if not len(first):
        return float("nan")
    gains = (second - first) if higher_is_better else (first - second)
    return float(np.mean(gains > 0) + np.mean(gains == 0) / 2)
