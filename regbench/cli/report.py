"""regbench report: a page to look at, of one run or several."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Data


def report(
    runs: Annotated[list[Path] | None, typer.Argument(help="Run folders; the latest run if none is named.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="HTML file to write.")] = Path("report.html"),
    paper: Annotated[bool, typer.Option(help="Put the paper's own figures beside ours.")] = False,
    protocol: Annotated[list[str] | None, typer.Option("--protocol", "-p", help="Only these protocols.")] = None,
    method: Annotated[list[str] | None, typer.Option("--method", "-m", help="Only these methods.")] = None,
    mixed: Annotated[bool, typer.Option(help="Put together what does not compare (docs/report.md).")] = False,
    data: Data = None,
) -> None:
    """Write one page that opens anywhere, offline: tables, curves, pairs to turn, failures, versions and hardware."""
    from regbench.cli.output import write_output
    from regbench.registry import split_names
    from regbench.report.page import report_page
    from regbench.runner.rundir import find_run

    page, left_out = report_page(
        [find_run(path) for path in runs] if runs else [find_run(None)],
        paper=paper,
        protocols=split_names(protocol),
        methods=split_names(method),
        mixed=mixed,
        data_dir=data,
    )
    write_output(out, page.encode())
    for words in left_out:
        print(f"regbench: {words}", file=sys.stderr)
    print(f"wrote {out}")
