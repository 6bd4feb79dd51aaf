"""regbench reproduce: a published experiment that is more than a table of methods, or a run from its manifest."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Data
from regbench.cli.train import Device


def reproduce(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help="An experiment, one of the names below; or the folder of a run.")],
    steps: Annotated[int, typer.Option(min=1, help="Optimiser steps of each training.")] = 1000,
    limit: Annotated[
        int | None,
        typer.Option(min=1, help="Only the first so many problems (else all, or the experiment's own number)."),
    ] = None,
    weights: Annotated[
        str | None, typer.Option(help="Weights for what needs no training of its own: a name or a .safetensors file.")
    ] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", help="training.KEY=VALUE or method.KEY=VALUE over the trainings'.")
    ] = None,
    device: Annotated[Device, typer.Option(help="auto: CUDA where there is one.")] = "auto",
    threads: Annotated[int, typer.Option(min=1, help="CPU threads.")] = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Trials at a time (else 1; of a run, as it had).")] = None,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write (else runs/NAME, or runs/RUN-again).")] = None,
) -> int:
    """Reproduce a published experiment, with the paper's figures beside ours; or a run, bit for bit.

    Of a RUN, every trial is run again into a new folder; exit code 1 if any transform is not the same. The same command
    continues after Ctrl-C; what is finished is not done again.
    """
    from regbench import registry

    if name not in registry.names(registry.REPRODUCTIONS) and _is_folder(name):
        return _again(context, name, limit, jobs, data, out)
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
            jobs=jobs or 1,
            progress=progress,
            say=say,
        )
    if signal is not None:
        return 128 + int(signal)
    print(f"wrote {folder}")
    return 0


def _is_folder(name: str) -> bool:
    return "/" in name or Path(name).is_dir() or Path("runs", name).is_dir()


def _again(
    context: typer.Context, name: str, limit: int | None, jobs: int | None, data: Path | None, out: Path | None
) -> int:
    from regbench.cli.interrupt import any_stop_as_interrupt
    from regbench.cli.options import refuse_given
    from regbench.cli.progress import progress_display
    from regbench.report.rundata import read_run
    from regbench.reproduction.replay import default_out, replay
    from regbench.reproduction.sameness import compare, in_words, surroundings
    from regbench.runner.run import run as run_trials
    from regbench.runner.rundir import find_run

    experiments = ("steps", "weights", "changes", "device", "threads")
    refuse_given(context, experiments, "goes with an experiment; a RUN is repeated with what its manifest says")
    original = find_run(Path(name))
    before, folder = read_run(original), out or default_out(original)
    configs = replay(original, before, folder, limit=limit, data=data, jobs=jobs)
    with any_stop_as_interrupt(), progress_display(sys.stderr) as progress:
        for config in configs:
            run_trials(config, command=sys.argv, progress=progress)
    comparisons = compare(before, read_run(folder), limit)
    print(in_words(comparisons, surroundings(original, folder)))
    return 0 if all(found.is_same for found in comparisons) else 1
