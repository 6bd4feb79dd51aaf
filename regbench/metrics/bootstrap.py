"""How far a figure, or a difference between two methods, may be due to the problems that happened to be drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regbench.metrics.reduction import QUANTILES, Reduction

Array = NDArray[np.float64]
Counts = NDArray[np.int32]
RESAMPLES, LEVEL = 10_000, 0.95
# Resamples at a time: their counts are so many rows of n numbers.
AT_ONCE = 250


@dataclass(frozen=True, eq=False)
class PairedValues:
    """What two methods have of one metric on the same n trials.

    Attributes:
        first: (n,) float64.
        second: (n,) float64.
        reduction: From them to the metric's figure.
    """

    first: Array
    second: Array
    reduction: Reduction


def paired_intervals(
    columns: Sequence[PairedValues],
    rng: np.random.Generator,
    *,
    problems: NDArray[np.int64] | None = None,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
) -> list[tuple[float, float]]:
    """Return percentile intervals of the differences, second less first, of several metrics over the same n trials.

    The paired bootstrap (Efron and Tibshirani 1993, chapters 8 and 13): trials are drawn with replacement, both
    methods' together, and the figures are computed anew. A resample is n counts, one for each trial: a mean is then a
    product, and a quantile is where the counts of the sorted trials reach its rank.

    Args:
        columns: With the same n each, n >= 1.
        rng: Of the draws; all metrics see the same ones.
        problems: (n,) of the trials, to draw problems, all trials of one together (see `figure_intervals`); None: each
            trial is of a problem of its own.
        resamples: How many.
        level: Share of the resamples within the interval.

    Raises:
        ValueError: The columns differ in length, or are empty.
    """
    lengths = {len(values) for column in columns for values in (column.first, column.second)}
    if len(lengths) != 1 or 0 in lengths:
        raise ValueError(f"paired values must be as many of each and at least one, got {sorted(lengths)}")
    (n,) = lengths
    differences: list[list[Array]] = [[] for _ in columns]
    for counts in _counts_of_trials(np.arange(n) if problems is None else problems, resamples, rng):
        for column, found in zip(columns, differences, strict=True):
            found.append(
                _figures(counts, column.second, column.reduction) - _figures(counts, column.first, column.reduction)
            )
    return [_limits(found, level) for found in differences]


def figure_intervals(
    columns: Sequence[tuple[Array, Reduction]],
    problems: NDArray[np.int64],
    rng: np.random.Generator,
    *,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
) -> list[tuple[float, float]]:
    """Return percentile intervals of the figures of several metrics over the same n trials of one method.

    As `paired_intervals`, but what is drawn is problems, all trials of one together: a method that answers the same
    each time is not surer of its figure for having answered ten times.

    Args:
        columns: For each metric its (n,) values and what makes a figure of them, n >= 1.
        problems: (n,) of the trials.
        rng: Of the draws; all metrics see the same ones.
        resamples: How many.
        level: Share of the resamples within the interval.

    Raises:
        ValueError: A column is not as long as `problems`, or they are empty.
    """
    if not len(problems) or any(len(values) != len(problems) for values, _ in columns):
        lengths = sorted({len(values) for values, _ in columns})
        raise ValueError(f"values must be as many as problems and at least one, got {lengths} and {len(problems)}")
    figures: list[list[Array]] = [[] for _ in columns]
    for counts in _counts_of_trials(problems, resamples, rng):
        for (values, reduction), found in zip(columns, figures, strict=True):
            found.append(_figures(counts, values, reduction))
    return [_limits(found, level) for found in figures]


def _limits(figures: Sequence[Array], level: float) -> tuple[float, float]:
    low, high = np.quantile(np.concatenate(figures), ((1 - level) / 2, (1 + level) / 2))
    return float(low), float(high)


def _counts_of_trials(problems: NDArray[np.int64], resamples: int, rng: np.random.Generator) -> Iterator[Counts]:
    """Yield (b, n) counts of n trials: those of one problem are drawn together."""
    numbers, place = np.unique(problems, return_inverse=True)
    for counts in _counts(len(numbers), resamples, rng):
        yield counts if len(numbers) == len(problems) else counts[:, place]


def _counts(n: int, resamples: int, rng: np.random.Generator) -> Iterator[Counts]:
    """Yield (b, n) counts: how often each problem is in each of b resamples."""
    for first in range(0, resamples, AT_ONCE):
        rows = min(AT_ONCE, resamples - first)
        drawn = rng.integers(0, n, (rows, n)) + n * np.arange(rows)[:, None]
        yield np.bincount(drawn.ravel(), minlength=rows * n).reshape(rows, n).astype(np.int32)


def _figures(counts: Counts, values: Array, reduction: Reduction) -> Array:
    """Return (b,) figures of (b, n) counts of (n,) values."""
    totals = counts.sum(axis=1)
    if reduction not in QUANTILES:
        means: Array = counts.astype(np.float64) @ values / totals
        return means if reduction == "mean" else np.sqrt(means)
    order = np.argsort(values)
    # 32 bits hold all counts, and take less time than 64.
    cumulated, ascending = np.cumsum(counts[:, order], axis=1, dtype=np.int32), values[order]
    rank = QUANTILES[reduction] * (totals - 1)
    # The value of rank k is the first one that more than k counts reach.
    low, high = (
        ascending[(cumulated <= whole.astype(np.int32)[:, None]).sum(axis=1)]
        for whole in (np.floor(rank), np.ceil(rank))
    )
    figures: Array = low + (rank - np.floor(rank)) * (high - low)
    return figures
