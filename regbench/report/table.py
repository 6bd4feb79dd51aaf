"""The table of one run or several, in any format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.metrics.table import METRICS, Metric, find_metrics
from regbench.report.cloud_metrics import cloud_errors
from regbench.report.compared import add_improvements, mark_worse
from regbench.report.csv_table import csv_table
from regbench.report.improvement import improvement_column
from regbench.report.intervals import intervals
from regbench.report.json_table import json_table
from regbench.report.latex_table import latex_table
from regbench.report.layout import Column, Notes, lay_out
from regbench.report.manifest import ProtocolInfo
from regbench.report.markdown_table import markdown_table
from regbench.report.merge import read_runs
from regbench.report.paired import TrialValues
from regbench.report.published import published_rows
from regbench.report.rundata import RunData
from regbench.report.summary import sections, summarise_group
from regbench.report.text_table import text_table
from regbench.suggest import unknown

FORMATS = ("text", "csv", "markdown", "latex", "json")
BESIDE_HEADLINE = ("recall_5deg", "time_median_ms")


def render(
    runs: Sequence[Path],
    *,
    format: str,
    paper: bool = False,
    metrics: Sequence[str] | None = None,
    protocols: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    mixed: bool = False,
    with_intervals: bool = False,
    improvement: str | None = None,
    data_dir: Path | None = None,
) -> str:
    """Return the table of run folders. Whatever the options, trials and failures are in it.

    Args:
        runs: Run folders; where two hold the same trial, the later one's counts.
        format: One of FORMATS.
        paper: Put the paper's rows beside ours, under the protocols that stand for its column groups.
        metrics: Keys of the columns; None for each protocol's headline metrics (text and Markdown add recall and
            time; CSV and JSON have all). JSON always has all, and the ones that need the clouds where asked for.
        protocols: Only these ids; None for all.
        methods: Only these, as they were asked for; None for all.
        mixed: Print side by side what does not compare (see merge.py).
        with_intervals: Put an interval beside each figure of ours.
        improvement: Key of a metric: a column more, how often a row is better in it than the best one.
        data_dir: Prepared data, for the metrics that need the clouds.

    Raises:
        UserError: An unknown format, metric, protocol or method, or a run that cannot be read.
    """
    if format not in FORMATS:
        raise UserError(unknown("format", format, FORMATS))
    asked = find_metrics(metrics) if metrics is not None else None
    compared = find_metrics([improvement] if improvement is not None else [])
    run = choose(read_runs(runs, mixed=mixed), protocols, methods)
    infos = {group.protocol.label: group.protocol for group in run.groups}
    columns = {label: asked or headline(info, format) for label, info in infos.items()}
    needs_clouds = any(metric.needs == "clouds" for chosen in (*columns.values(), compared) for metric in chosen)
    errors = cloud_errors(run, data_dir) if needs_clouds else None
    values = [TrialValues.of(group, run, errors) for group in run.groups]
    rows = [
        summarise_group(group, trials.samples, errors or {}) for group, trials in zip(run.groups, values, strict=True)
    ]
    mark_worse(run, rows, values)
    if with_intervals:
        for row, trials in zip(rows, values, strict=True):
            full = asked or [metric for metric in METRICS.values() if metric.key in row]
            row |= intervals(trials, full if format in ("csv", "json") else columns[row["protocol"]])
    for metric in compared:
        add_improvements(run, rows, values, metric)
    extra = [improvement_column(metric) for metric in compared]
    by_protocol = sections(rows)
    if paper:
        add_published(by_protocol, infos)
    if format == "json":
        return json_table([row for section in by_protocol.values() for row in section])
    if format == "csv":
        chosen = asked or [metric for metric in METRICS.values() if any(metric.key in row for row in rows)]
        return csv_table([row for section in by_protocol.values() for row in section], [*chosen, *extra])
    return _printed(format, run, by_protocol, infos, {label: [*chosen, *extra] for label, chosen in columns.items()})


def _printed(
    format: str,
    run: RunData,
    by_protocol: Mapping[str, Sequence[Mapping[str, Any]]],
    infos: Mapping[str, ProtocolInfo],
    columns: Mapping[str, Sequence[Column]],
) -> str:
    one_machine = len(run.machines) == 1
    together = Notes()  # LaTeX has one list of footnotes; the others have one under each protocol
    laid_out = []
    for label, section in by_protocol.items():
        notes = together if format == "latex" else Notes()
        laid_out.append((lay_out(infos[label], section, columns[label], notes, rank_times=one_machine), notes))
    if format == "latex":
        return latex_table([section for section, _ in laid_out], together, remarks_on(run, format))
    return {"text": text_table, "markdown": markdown_table}[format](laid_out, remarks_on(run, format))


def headline(protocol: ProtocolInfo, format: str) -> list[Metric]:
    """Return the default columns: what the protocol's paper prints, and beside it recall and time where there is room.

    Raises:
        UserError: The manifest names a metric that is unknown.
    """
    beside = () if format == "latex" else BESIDE_HEADLINE
    return find_metrics(dict.fromkeys([*protocol.headline_metrics, *beside]))


def choose(run: RunData, protocols: Sequence[str] | None, methods: Sequence[str] | None) -> RunData:
    """Return the groups of the named protocols and methods.

    Raises:
        UserError: A name is not in the runs, or nothing is left.
    """
    for what, asked, known in (
        ("protocol", protocols, {group.protocol.id for group in run.groups}),
        ("method", methods, {group.method.method for group in run.groups}),
    ):
        for name in asked or ():
            if name not in known:
                raise UserError(unknown(what, name, sorted(known), of="these runs"))
    groups = [
        group
        for group in run.groups
        if (protocols is None or group.protocol.id in protocols) and (methods is None or group.method.method in methods)
    ]
    if not groups:
        raise UserError("nothing to show: the runs have no method on a protocol")
    return replace(run, groups=groups)


def add_published(by_protocol: dict[str, list[dict[str, Any]]], infos: Mapping[str, ProtocolInfo]) -> None:
    """Put the paper's rows under the protocols that stand for its column groups.

    Raises:
        UserError: No protocol here does.
    """
    beside = {label: group for label in by_protocol if (group := infos[label].published) is not None}
    if not beside:
        raise UserError(f"the paper has no figures for {', '.join(by_protocol)}; leave out --paper")
    for label, group in beside.items():
        by_protocol[label] += published_rows(group, label)


def remarks_on(run: RunData, format: str) -> list[str]:
    """Return what a reader must know of the whole table."""
    remarks = [f"Measured on {'; '.join(run.machines)}."]
    if len(run.machines) > 1:
        remarks[0] += " Times of different machines do not compare: they are not ranked."
    if run.times_left_out:
        others = " and ".join(f"of {count:,} rows from {machine}" for machine, count in run.times_left_out.items())
        remarks[0] += f" Times {others} are left out (--mixed puts all together)."
    if run.stale and format != "latex":  # a printed table's reader knows of no older rows
        remarks.append(f"{run.stale} rows of methods or protocols that have changed since are left out.")
    return remarks
