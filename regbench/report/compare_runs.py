"""From two run folders and conditions to a table and what fails: refused where rows would not compare."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from regbench.errors import UserError
from regbench.metrics.table import Metric, find_metrics
from regbench.report.cloud_metrics import cloud_errors
from regbench.report.comparison import compare, incomparable, renamed
from regbench.report.comparison_table import comparison_table, remarks_on
from regbench.report.fail_if import broken, parse_condition
from regbench.report.rundata import RunData, read_run
from regbench.report.table import choose, headline


def compare_runs(
    first: Path,
    second: Path,
    *,
    conditions: Sequence[str],
    metrics: Sequence[str] | None,
    protocols: Sequence[str] | None,
    methods: Sequence[str] | None,
    against: str | None,
    anyway: bool,
    format: str,
    data_dir: Path | None,
) -> tuple[str, list[str]]:
    """Return the table, and a line for each condition that fails.

    Args:
        first: Folder of the run before.
        second: Folder of the run after.
        conditions: As fail_if.py reads them; their metrics join the table.
        metrics: Keys; None for the protocols' headline metrics, recall and time.
        protocols: Only these ids; None for all.
        methods: Only these, as they were asked for; None for all.
        against: A method of the second run to compare the one method named with.
        anyway: Compare what does not compare, and say so.
        format: One of comparison_table.FORMATS.
        data_dir: Prepared data, for the metrics that need the clouds.

    Raises:
        UserError: An unknown name, a condition that is none, a run that cannot be read, or rows that do not compare.
    """
    parsed = [parse_condition(text) for text in conditions]
    if against is not None and len(methods or ()) != 1:
        raise UserError(f"--against {against}: name the one method to compare with it by --method")
    before = choose(read_run(first), protocols, methods)
    after = read_run(second)
    if against is None:
        after = choose(after, protocols, None)
    elif methods is not None:
        name = f"{methods[0]} -> {against}"
        before = renamed(before, methods[0], name)
        after = renamed(choose(after, protocols, [against]), against, name)
    asked = find_metrics(metrics) if metrics is not None else _headlines(before)
    asked = list(dict.fromkeys([*asked, *(c.metric for c in parsed if c.metric is not None)]))
    reasons = incomparable(before, after, asked)
    if reasons and not anyway:
        hint = "; leave something out (--method, --protocol, --metric), or give --anyway to go on"
        raise UserError(f"{first} and {second} do not compare: {'; '.join(reasons)}{hint}")
    clouds = any(metric.needs == "clouds" for metric in asked)
    errors = (cloud_errors(before, data_dir), cloud_errors(after, data_dir)) if clouds else None
    comparisons = compare(before, after, asked, errors)
    if not comparisons:
        raise UserError(f"{first} and {second}: no method has a trial of the same problem in both")
    remarks = [f"Does not compare, and was asked for anyway: {reason}." for reason in reasons]
    return comparison_table(comparisons, format, [*remarks_on(comparisons), *remarks]), broken(parsed, comparisons)


def _headlines(run: RunData) -> list[Metric]:
    """Return the default metrics of all protocols, each once."""
    return list(dict.fromkeys(metric for group in run.groups for metric in headline(group.protocol, "text")))
