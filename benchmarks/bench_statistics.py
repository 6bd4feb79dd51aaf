"""How long the statistics of a comparison take, beside SciPy's bootstrap: python benchmarks/bench_statistics.py.

Both sides draw 10,000 resamples of the same 2,468 pairs, the test set of ModelNet40, and give the 95 % interval of a
difference between two methods.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from scipy.stats import bootstrap

from regbench.metrics.bootstrap import RESAMPLES, PairedValues, figure_intervals, paired_intervals
from regbench.metrics.paired_tests import holm, probability_of_improvement, signed_rank_p
from regbench.metrics.reduction import Reduction

Interval = tuple[float, float]


def seconds(call: Callable[[], object], rounds: int) -> float:
    """Return the median of some rounds."""
    found = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        found.append(time.perf_counter() - start)
    return statistics.median(found)


def ours(first: np.ndarray, second: np.ndarray, reduction: Reduction) -> Interval:
    return paired_intervals([PairedValues(first, second, reduction)], np.random.default_rng(0))[0]


def scipys(first: np.ndarray, second: np.ndarray, reduction: Reduction) -> Interval:
    figure = {"mean": np.mean, "median": np.median}[reduction]
    found = bootstrap(
        (first, second),
        lambda a, b, axis: figure(b, axis=axis) - figure(a, axis=axis),
        paired=True,
        vectorized=True,
        method="percentile",
        n_resamples=RESAMPLES,
        batch=250,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(found.low), float(found.high)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--pairs", type=int, default=2468)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    first = rng.gamma(2.0, 1.0, arguments.pairs)
    second = first * rng.uniform(0.7, 1.2, arguments.pairs)
    print(f"{RESAMPLES:,} resamples x {arguments.pairs:,} pairs, median of {arguments.rounds}")
    reduction: Reduction
    for reduction in ("mean", "median"):
        mine = seconds(lambda r=reduction: ours(first, second, r), arguments.rounds)
        theirs = seconds(lambda r=reduction: scipys(first, second, r), arguments.rounds)
        print(f"difference of a {reduction}")
        print(
            f"  regbench  {mine:7.3f} s     1.00 x   [{', '.join(f'{x:.4f}' for x in ours(first, second, reduction))}]"
        )
        ends = ", ".join(f"{x:.4f}" for x in scipys(first, second, reduction))
        print(f"  SciPy     {theirs:7.3f} s  {theirs / mine:7.2f} x   [{ends}]")
    problems = np.arange(arguments.pairs)
    six = [(first, reduction) for reduction in ("root mean", "mean", "median", "p75", "p95", "mean")]
    for words, call in (
        ("intervals of one method's six figures", lambda: figure_intervals(six, problems, np.random.default_rng(0))),
        ("signed-rank test", lambda: signed_rank_p(first, second, higher_is_better=False)),
        ("Holm's correction of 14", lambda: holm(list(rng.uniform(size=14)))),
        ("probability of improvement", lambda: probability_of_improvement(first, second, higher_is_better=False)),
    ):
        print(f"{words:40s} {seconds(call, arguments.rounds):9.5f} s")


if __name__ == "__main__":
    main()
