"""regbench compare: two runs against each other, for a reader or for CI."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from regbench.cli.options import Data

Format = Literal["text", "markdown", "csv", "json"]


def compare(
    first: Annotated[Path, typer.Argument(help="Folder of the run before.")],
    second: Annotated[Path, typer.Argument(help="Folder of the run after.")],
    fail_if: Annotated[
        list[str] | None,
        typer.Option(help="Exit code 1 if so, e.g. 'recall drops by 0.01', 'time grows by 20%'; may be repeated."),
    ] = None,
    metric: Annotated[
        list[str] | None, typer.Option(help="Metrics, see `regbench ls metrics`; may be repeated.")
    ] = None,
    protocol: Annotated[list[str] | None, typer.Option(help="Only these protocols.")] = None,
    method: Annotated[list[str] | None, typer.Option(help="Only these methods.")] = None,
    against: Annotated[str | None, typer.Option(help="Compare --method with this method of the second run.")] = None,
    anyway: Annotated[bool, typer.Option(help="Go on where rows do not compare; it is said which.")] = False,
    format: Annotated[Format, typer.Option("--format", "-f", help="How the table is written.")] = "text",
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write to this file.")] = None,
    data: Data = None,
) -> int:
    """Compare two runs method by method: differences with intervals, a verdict, and conditions for CI."""
    from regbench.cli.output import write_output
    from regbench.registry import split_names
    from regbench.report.compare_runs import compare_runs
    from regbench.runner.rundir import find_run

    text, failed = compare_runs(
        find_run(first),
        find_run(second),
        conditions=fail_if or [],
        metrics=split_names(metric),
        protocols=split_names(protocol),
        methods=split_names(method),
        against=against,
        anyway=anyway,
        format=format,
        data_dir=data,
    )
    if out is None:
        print(text)
    else:
        write_output(out, text.encode() + b"\n")
    for line in failed:
        print(f"fails: {line}", file=sys.stderr)
    return 1 if failed else 0
