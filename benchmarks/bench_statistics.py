"""How long the statistics of a comparison take, beside SciPy's bootstrap: python benchmarks/bench_statistics.py.

Both sides draw 10,000 resamples of the same 2,468 pairs, the test set of ModelNet40, and give the 95 % interval of a
difference between two methods. One thread.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

import numpy as np
from scipy.stats import bootstrap

from regbench.metrics.bootstrap import AT_ONCE, RESAMPLES, PairedValues, figure_intervals, paired_intervals
from regbench.metrics.paired_tests import holm, probability_of_improvement, signed_rank_p
from regbench.metrics.reduction import QUANTILES, Reduction

Interval = tuple[float, float]


def timed(call: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Return the medians of wall and CPU time over some rounds, in seconds."""
    walls, cpus = [], []
    for _ in range(rounds):
        wall, cpu = time.perf_counter(), time.process_time()
        call()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return statistics.median(walls), statistics.median(cpus)


def ours(first: np.ndarray, second: np.ndarray, reduction: Reduction) -> Interval:
    return paired_intervals([PairedValues(first, second, reduction)], np.random.default_rng(0))[0]


def scipys(first: np.ndarray, second: np.ndarray, reduction: Reduction) -> Interval:
    def figure(values: np.ndarray, axis: int) -> np.ndarray:
        if reduction == "mean":
            return np.mean(values, axis=axis)
        return np.quantile(values, QUANTILES[reduction], axis=axis)

    found = bootstrap(
        (first, second),
        lambda a, b, axis: figure(b, axis) - figure(a, axis),
        paired=True,
        vectorized=True,
        method="percentile",
        n_resamples=RESAMPLES,
        batch=AT_ONCE,
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
    print(f"{RESAMPLES:,} resamples x {arguments.pairs:,} pairs, medians of {arguments.rounds}, one thread")
    print(f"{'interval of a difference of':42s} {'wall':>9s} {'CPU':>9s} {'to ours':>8s}   interval")
    reductions: tuple[Reduction, ...] = ("mean", "median", "p95")
    for reduction in reductions:
        reference = 0.0
        for name, interval in (("regbench", ours), ("SciPy", scipys)):
            wall, cpu = timed(lambda f=interval, r=reduction: f(first, second, r), arguments.rounds)
            reference = reference or cpu
            low, high = interval(first, second, reduction)
            words = f"{reduction}s: {name}"
            print(f"{words:42s} {wall:7.3f} s {cpu:7.3f} s {cpu / reference:8.2f}   [{low:.4f}, {high:.4f}]")
    problems = np.arange(arguments.pairs)
    six = [(first, reduction) for reduction in ("root mean", "mean", "median", "p75", "p95", "mean")]
    print("other")
    for words, call in (
        ("intervals of one method's six figures", lambda: figure_intervals(six, problems, np.random.default_rng(0))),
        ("signed-rank test", lambda: signed_rank_p(first, second, higher_is_better=False)),
        ("Holm's correction of 14", lambda: holm(list(rng.uniform(size=14)))),
        ("probability of improvement", lambda: probability_of_improvement(first, second, higher_is_better=False)),
    ):
        wall, cpu = timed(call, arguments.rounds)
        print(f"{words:42s} {wall:7.5f} s {cpu:7.5f} s")


if __name__ == "__main__":
    main()
