"""regbench show: a method's worst, median and best pairs of a run, as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Data


def show(
    run: Annotated[Path | None, typer.Argument(help="Run folder; the latest run if none is named.")] = None,
    method: Annotated[list[str] | None, typer.Option("--method", "-m", help="Only these methods.")] = None,
    protocol: Annotated[list[str] | None, typer.Option("--protocol", "-p", help="Only these protocols.")] = None,
    worst: Annotated[int | None, typer.Option(min=0, help="So many of the worst pairs (else 5).")] = None,
    median: Annotated[int, typer.Option(min=0, help="So many of the middle.")] = 0,
    best: Annotated[int, typer.Option(min=0, help="So many of the best.")] = 0,
    png: Annotated[Path | None, typer.Option(help="Folder for a PNG file of each; needs no display.")] = None,
    data: Data = None,
) -> None:
    """List pairs of a run; with --png, draw each before and after, coloured by distance."""
    from regbench.registry import split_names
    from regbench.report.show import save_png, shown_pairs
    from regbench.runner.rundir import find_run

    for shown in shown_pairs(
        find_run(run),
        methods=split_names(method),
        protocols=split_names(protocol),
        worst=(0 if median or best else 5) if worst is None else worst,
        median=median,
        best=best,
        data_dir=data,
    ):
        print(shown.words if png is None else f"{shown.words}: {save_png(shown, png)}")
