"""Conditions under which a comparison fails, such as "recall drops by 0.01" or "time grows by 20%"."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from regbench.errors import UserError
from regbench.metrics.table import METRICS, Metric
from regbench.report.comparison import Comparison

FAILURES = "failures"
# What people call the metrics that one looks at first.
SHORT = {"recall": "recall_5deg", "time": "time_median_ms", "rmse": "rmse_r_deg", "mae": "mae_r_deg"}
_FORM = re.compile(r"(\S+) (drops|falls|grows|rises) by (\d+(?:\.\d*)?(?:[eE][-+]?\d+)?) ?(%?)")
# 0.95 - 0.94 is a little more than 0.01, 0.29 - 0.28 a little less.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Condition:
    """A metric, a direction and by how much.

    Attributes:
        text: As given.
        metric: None for the number of failed trials.
        falls: Whether it is about a figure that gets smaller.
        amount: By at least this; of the first run's figure if `is_relative`.
        is_relative: Whether the amount is a share.
    """

    text: str
    metric: Metric | None
    falls: bool
    amount: float
    is_relative: bool

    def reached(self, before: float, after: float) -> bool:
        """Return whether a figure has changed so far; any growth from zero is more than any share of it."""
        change = (before - after) if self.falls else (after - before)
        if change <= 0:
            return False
        if self.is_relative:
            change = change / abs(before) if before else math.inf
        return change >= self.amount * (1 - ROUNDING)


def parse_condition(text: str) -> Condition:
    """Return the condition that a text states.

    Raises:
        UserError: It is none, or names no metric.
    """
    match = _FORM.fullmatch(" ".join(text.split()))
    if match is None:
        raise UserError(
            f"--fail-if '{text}': expected 'METRIC drops|falls|grows|rises by NUMBER[%]', such as "
            "'recall drops by 0.01' or 'time grows by 20%'"
        )
    name, verb, number, percent = match.groups()
    key = SHORT.get(name, name)
    if key != FAILURES and key not in METRICS:
        raise UserError(f"--fail-if '{text}': no metric '{name}'; there are {', '.join([*SHORT, FAILURES, *METRICS])}")
    amount = float(number) / (100 if percent else 1)
    if not math.isfinite(amount):
        raise UserError(f"--fail-if '{text}': {number} is more than any figure: it would never fail")
    return Condition(text, METRICS.get(key), verb in ("drops", "falls"), amount, bool(percent))


def broken(conditions: Sequence[Condition], comparisons: Sequence[Comparison]) -> list[str]:
    """Return a line for each condition and method that fails.

    A figure fails where it has changed so far and the interval of its change leaves zero out: noise alone does not
    fail, and a change that is shown but small does not either. The number of failed trials is taken as it is.

    Raises:
        UserError: No method has the metric of a condition in both runs, so that it would never fail.
    """
    lines = []
    for condition in conditions:
        judged = False
        for comparison in comparisons:
            where = f"{comparison.method} on {comparison.protocol}"
            if condition.metric is None:
                judged = True
                if condition.reached(comparison.failures_before, comparison.failures_after):
                    numbers = f"{comparison.failures_before} -> {comparison.failures_after}"
                    lines.append(f"{condition.text}: {where}, {FAILURES} {numbers} of {comparison.n}")
            elif _has_no_time_left(condition.metric, comparison):
                judged = True
                lines.append(f"{condition.text}: {where}, no time in the second run: all {comparison.n} trials failed")
            for difference in comparison.differences:
                if difference.metric is not condition.metric:
                    continue
                judged = True
                if difference.is_shown and condition.reached(difference.before, difference.after):
                    numbers = f"{difference.before:.6g} -> {difference.after:.6g}"
                    lines.append(f"{condition.text}: {where}, {difference.metric.key} {numbers}")
        if not judged:
            raise UserError(f"--fail-if '{condition.text}': no method has it in both runs")
    return lines


def _has_no_time_left(metric: Metric, comparison: Comparison) -> bool:
    return metric.needs == "times" and comparison.failures_after == comparison.n > comparison.failures_before
