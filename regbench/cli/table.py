"""regbench table: the table of one run or several."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from regbench.cli.options import Data

Format = Literal["text", "csv", "markdown", "latex", "json"]


def table(
    runs: Annotated[list[Path] | None, typer.Argument(help="Run folders; the latest run if none is named.")] = None,
    format: Annotated[Format, typer.Option("--format", "-f", help="How the table is written.")] = "text",
    paper: Annotated[bool, typer.Option(help="Put the paper's own figures beside ours.")] = False,
    metric: Annotated[
        list[str] | None, typer.Option(help="Metrics, see `regbench ls metrics`; may be repeated.")
    ] = None,
    protocol: Annotated[list[str] | None, typer.Option(help="Only these protocols.")] = None,
    method: Annotated[list[str] | None, typer.Option(help="Only these methods.")] = None,
    mixed: Annotated[bool, typer.Option(help="Put together what does not compare (docs/report.md).")] = False,
    intervals: Annotated[bool, typer.Option("--intervals", help="Put a 95 % interval beside each figure.")] = False,
    improvement: Annotated[
        str | None,
        typer.Option(metavar="METRIC", help="Add how often a row is better in this metric than the best row."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write to this file.")] = None,
    data: Data = None,
) -> None:
    """Print the table of a run."""
    from regbench.cli.output import write_output
    from regbench.registry import split_names
    from regbench.report.table import render
    from regbench.runner.rundir import find_run

    text = render(
        [find_run(path) for path in runs] if runs else [find_run(None)],
        format=format,
        paper=paper,
        metrics=split_names(metric),
        protocols=split_names(protocol),
        methods=split_names(method),
        mixed=mixed,
        with_intervals=intervals,
        improvement=improvement,
        data_dir=data,
    )
    if out is None:
        print(text)
    else:
        write_output(out, text.encode() + b"\n")
