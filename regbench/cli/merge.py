"""regbench merge: several run folders as one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def merge(
    runs: Annotated[list[Path], typer.Argument(help="Run folders.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to make.")],
    anyway: Annotated[
        bool, typer.Option(help="Where two runs have different answers to a trial, take the later folder's.")
    ] = False,
) -> None:
    """Make one run folder of several: shards of a run, or of several machines. `regbench run --out` goes on with it."""
    from regbench.report.rundata import read_run
    from regbench.runner.merge import merge_runs
    from regbench.runner.rundir import find_run

    folders = [find_run(path) for path in runs]
    for folder in folders:
        read_run(folder)  # what no table could read must not be made one folder with what it can
    trials, stale = merge_runs(folders, out, anyway=anyway)
    left = f"; {stale} rows of methods or protocols that have changed since were left behind" if stale else ""
    print(f"wrote {out}: {trials} trials{left}")
