"""A figure of one run or several, as a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from regbench.drawing import new_figure
from regbench.errors import UserError
from regbench.report.cloud_metrics import cloud_errors
from regbench.report.figures.kinds import KINDS
from regbench.report.figures.look import WIDTHS, printed_page
from regbench.report.figures.panel import Material
from regbench.report.figures.sheet import arrange, format_of, save
from regbench.report.merge import read_runs
from regbench.report.rundata import Group
from regbench.report.summary import summarise
from regbench.report.table import choose
from regbench.report.trials import Trials


def draw_figure(
    name: str,
    runs: Sequence[Path],
    out: Path,
    *,
    width: str = "column",
    choice: Sequence[str] | None = None,
    metrics: Sequence[str] | None = None,
    protocols: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    mixed: bool = False,
    data_dir: Path | None = None,
) -> None:
    """Draw a figure of run folders. Failures stand beside the methods' names, and count as the identity.

    Args:
        name: One of KINDS.
        runs: Run folders; where two hold the same trial, the later one's counts.
        out: File to write, .pdf, .svg or .png.
        width: One of WIDTHS.
        choice: Of the figure's own choices; None for what it takes unless asked.
        metrics: Keys of metrics; None for the figure's own.
        protocols: Only these ids; None for all.
        methods: Only these, as they were asked for; None for all.
        mixed: Draw together what does not compare (see merge.py), and times of different machines.
        data_dir: Prepared data, for the metrics that need the clouds.

    Raises:
        UserError: An unknown metric, protocol, method or choice, a run that cannot be read, something that does not
            fit the figure, matplotlib is not installed, or the file cannot be written.
    """
    kind = KINDS[name]
    chosen_metrics, chosen = kind.find_metrics(name, metrics), kind.find_choice(choice)
    format_of(out)
    new_figure()  # says before the runs are read that matplotlib is missing
    run = choose(read_runs(runs, mixed=mixed), protocols, methods)
    if kind.compares_times and run.times_left_out:
        machines = "; ".join([*run.machines, *run.times_left_out])
        raise UserError(
            f"plot {name}: times of different machines do not compare ({machines}); leave one out, or "
            "give --mixed to draw them together"
        )
    by_protocol: dict[str, list[Group]] = {}
    for group in run.groups:
        by_protocol.setdefault(group.protocol.label, []).append(group)
    by_protocol = {label: groups for label, groups in by_protocol.items() if any(group.trials for group in groups)}
    if not by_protocol:
        raise UserError("nothing to draw: the runs have no trial yet")
    if kind.compares_times and not any(_has_time(group.trials) for group in run.groups):
        raise UserError(f"plot {name}: no trial here has a time: all failed, or were run in batches")
    needs_clouds = any(metric.needs == "clouds" for metric in chosen_metrics)
    errors = cloud_errors(run, data_dir) if needs_clouds else None
    number = len(by_protocol) * max(1, len(chosen_metrics)) * max(1, len(chosen))
    material = Material(
        run,
        by_protocol,
        [row for row in summarise(run, errors) if row["protocol"] in by_protocol],
        chosen_metrics,
        errors,
        width=WIDTHS[width],
        columns=min(kind.abreast, number) if width == "page" else 1,
        choice=chosen,
    )
    with printed_page():
        save(arrange(kind.panels(material), material, kind.legend(material)), out)


def _has_time(trials: Trials) -> bool:
    return bool((trials.answered & np.isfinite(trials.time_ms)).any())
