"""regbench export: a run's trials, one row each, for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

Format = Literal["csv", "json", "parquet", "bop"]


def export(
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write.")],
    runs: Annotated[list[Path] | None, typer.Argument(help="Run folders; the latest run if none is named.")] = None,
    format: Annotated[Format, typer.Option("--format", "-f", help="What is written.")] = "csv",
    protocol: Annotated[list[str] | None, typer.Option(help="Only these protocols.")] = None,
    method: Annotated[list[str] | None, typer.Option(help="Only these methods.")] = None,
) -> None:
    """Write every trial of runs to a file: answers, errors, times, and what they belong to."""
    from regbench.cli.output import write_output
    from regbench.registry import split_names
    from regbench.report.export import export as content_of
    from regbench.report.trial_records import trial_records
    from regbench.runner.rundir import find_run

    folders = [find_run(path) for path in runs] if runs else [find_run(None)]
    records = list(trial_records(folders, protocols=split_names(protocol), methods=split_names(method)))
    content = content_of(records, format)
    write_output(out, content)
    written = content.count(b"\n") - 1 if format == "bop" else len(records)
    left = f" of {len(records)}; it has no row for those that failed, nor for repeats" if written < len(records) else ""
    print(f"wrote {out}: {written} trials{left}")
