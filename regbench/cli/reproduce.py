"""regbench reproduce: a published experiment that is more than a table of methods."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Data
from regbench.cli.train import Device


def reproduce(
    name: Annotated[str, typer.Argument(help="The experiment, one of the names below.")],
    steps: Annotated[int, typer.Option(min=1, help="Optimiser steps of each training.")] = 1000,
    limit: Annotated[int, typer.Option(min=1, help="Problems that each measurement takes.")] = 100,
    weights: Annotated[
        str | None, typer.Option(help="Weights for what needs no training of its own: a name or a .safetensors file.")
    ] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", help="training.KEY=VALUE or method.KEY=VALUE over the trainings'.")
    ] = None,
    device: Annotated[Device, typer.Option(help="auto: CUDA where there is one.")] = "auto",
    threads: Annotated[int, typer.Option(min=1, help="CPU threads.")] = 1,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(help="Folder of tables and figures (else runs/NAME).")] = None,
) -> int:
    """Reproduce a published experiment: trainings, measurements, tables, figures.

    The same command continues after Ctrl-C; what is finished is not done again.
    """
    from regbench import registry
    from regbench.cli.progress import say
    from regbench.cli.training_progress import training_display
    from regbench.datasets.store import data_dir

    run = registry.load(registry.REPRODUCTIONS, name, what="experiment", listing="`regbench reproduce --help`")
    folder = out or Path("runs") / name
    with training_display(sys.stderr) as progress:
        signal = run(
            folder,
            data=data_dir(data),
            steps=steps,
            limit=limit,
            weights=weights,
            changes=changes or [],
            device=device,
            threads=threads,
            progress=progress,
            say=say,
        )
    if signal is not None:
        return 128 + int(signal)
    print(f"wrote {folder}")
    return 0
