"""A comparison of two runs, written as text, Markdown, CSV or JSON."""

from __future__ import annotations

import csv
import io
import json
import textwrap
from collections.abc import Sequence
from typing import Any

from regbench.report.comparison import Comparison, Difference
from regbench.report.disturbed import WORDS
from regbench.report.markdown_table import escape
from regbench.report.text_table import WIDTH

FORMATS = ("text", "markdown", "csv", "json")
HEADER = ("method", "n", "metric", "before", "after", "change", "95 % interval", "")
RIGHT = (False, True, False, True, True, True, True, False)
COLUMNS = (
    *("protocol", "method", "method_changed", "metric", "n", "before", "after", "change", "low", "high", "verdict"),
    *("trials", "trials_before", "trials_after", "failures_before", "failures_after", "times_disturbed"),
)
LEGEND = (
    "Change: second run less first, over the trials of both. Interval: paired bootstrap over problems, 10,000 "
    "resamples. Failed trials are scored as the identity; times are of the trials that answered in both."
)


def remarks_on(comparisons: Sequence[Comparison]) -> list[str]:
    """Return what a reader must know of the figures: which trials they leave out, and times that were disturbed."""
    remarks = []
    for comparison in comparisons:
        n, before, after = comparison.n, comparison.n_before, comparison.n_after
        if n < max(before, after):
            remarks.append(f"{comparison.protocol}: {n:,} trials are in both runs, of {before:,} and {after:,}.")
    for protocol in dict.fromkeys(comparison.protocol for comparison in comparisons):
        disturbed = [
            comparison.method
            for comparison in comparisons
            if comparison.protocol == protocol and comparison.times_disturbed and _is_timed(comparison)
        ]
        if disturbed:
            remarks.append(f"{protocol}: times of {', '.join(disturbed)} in one of the runs are {WORDS}")
    return list(dict.fromkeys(remarks))


def _is_timed(comparison: Comparison) -> bool:
    return any(difference.metric.needs == "times" for difference in comparison.differences)


def comparison_table(comparisons: Sequence[Comparison], format: str, remarks: Sequence[str]) -> str:
    """Return the table in one of FORMATS; CSV and JSON have a row for each figure, and no remarks."""
    if format == "json":
        return json.dumps(_records(comparisons), indent=1)
    if format == "csv":
        file = io.StringIO()
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(_records(comparisons))
        return file.getvalue().rstrip("\n")
    protocols = dict.fromkeys(comparison.protocol for comparison in comparisons)
    if format == "markdown":
        tables = [_markdown(protocol, _lines(comparisons, protocol)) for protocol in protocols]
        return "\n\n".join([*tables, LEGEND, *map(escape, remarks)])
    tables = [_text(protocol, _lines(comparisons, protocol)) for protocol in protocols]
    below = "\n".join(line for text in (LEGEND, *remarks) for line in textwrap.wrap(text, WIDTH))
    return "\n\n".join([*tables, below])


def _records(comparisons: Sequence[Comparison]) -> list[dict[str, Any]]:
    return [
        {
            "protocol": comparison.protocol,
            "method": comparison.method,
            "method_changed": comparison.has_changed,
            "metric": difference.metric.key,
            "n": difference.n,
            "before": difference.before,
            "after": difference.after,
            "change": difference.change,
            "low": difference.low,
            "high": difference.high,
            "verdict": difference.verdict,
            "trials": comparison.n,
            "trials_before": comparison.n_before,
            "trials_after": comparison.n_after,
            "failures_before": comparison.failures_before,
            "failures_after": comparison.failures_after,
            "times_disturbed": comparison.times_disturbed,
        }
        for comparison in comparisons
        for difference in comparison.differences
    ]


def _lines(comparisons: Sequence[Comparison], protocol: str) -> list[list[str]]:
    """Return the cells of a protocol's rows; a method's name stands in its first row alone."""
    lines: list[list[str]] = []
    for comparison in comparisons:
        if comparison.protocol != protocol:
            continue
        rows = [_cells(difference) for difference in comparison.differences]
        before, after = comparison.failures_before, comparison.failures_after
        if before or after or not rows:
            rows.append([str(comparison.n), "failures", str(before), str(after), f"{after - before:+d}", "", ""])
        name = comparison.method + (" (changed)" if comparison.has_changed else "")
        lines += [[name if place == 0 else "", *row] for place, row in enumerate(rows)]
    return lines


def _cells(difference: Difference) -> list[str]:
    decimals = difference.metric.decimals
    before, after = (f"{value:.{decimals}f}" for value in (difference.before, difference.after))
    change, low, high = (f"{value:+.{decimals}f}" for value in (difference.change, difference.low, difference.high))
    unit = f" ({difference.metric.unit})" if difference.metric.unit else ""
    interval = f"[{low}, {high}]"
    return [str(difference.n), difference.metric.name + unit, before, after, change, interval, difference.verdict]


def _text(protocol: str, lines: Sequence[Sequence[str]]) -> str:
    table = [HEADER, *lines]
    widths = [max(len(line[column]) for line in table) for column in range(len(HEADER))]
    rows = [
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(line, widths, RIGHT, strict=True)
        ).rstrip()
        for line in table
    ]
    return "\n".join([protocol, rows[0], "-" * max(map(len, rows)), *rows[1:]])


def _markdown(protocol: str, lines: Sequence[Sequence[str]]) -> str:
    rule = ["---:" if right else "---" for right in RIGHT]
    rows = [f"| {' | '.join(row)} |" for row in (HEADER, rule, *([escape(cell) for cell in line] for line in lines))]
    return "\n".join([f"**{escape(protocol)}**", "", *rows])
