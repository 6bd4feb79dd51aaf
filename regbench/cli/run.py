"""regbench run: methods on protocols, rows into a journal, a table at the end."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from regbench.cli.options import Data, Plugins


def run(
    context: typer.Context,
    method: Annotated[list[str] | None, typer.Option("--method", "-m", help="e.g. icp,fgr[preset=paper].")] = None,
    protocol: Annotated[list[str] | None, typer.Option("--protocol", "-p", help="e.g. modelnet40/clean@1.")] = None,
    limit: Annotated[int | None, typer.Option(help="Only the first N problems of each protocol.")] = None,
    repeat: Annotated[int, typer.Option(help="Times that every problem is run, in interleaved rounds.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the methods' random choices; problems do not depend on it.")] = 0,
    timeout: Annotated[float, typer.Option(help="Seconds that a trial may take.")] = 60.0,
    memory: Annotated[float, typer.Option(help="GB that a worker may use.")] = 8.0,
    jobs: Annotated[int, typer.Option(help="Trials at a time, each on cores of its own.")] = 1,
    threads: Annotated[int, typer.Option(help="Threads (and cores) a method may use.")] = 1,
    batch: Annotated[int, typer.Option(help="Problems at once, for methods that can: accuracy alone.")] = 1,
    device: Annotated[str, typer.Option(help="cpu, cuda or cuda:N.")] = "cpu",
    executor: Annotated[str, typer.Option(help="Who carries out the trials: local, or dask.")] = "local",
    scheduler: Annotated[str | None, typer.Option(help="Of dask, e.g. tcp://host:8786 (else one of its own).")] = None,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the run (else one under runs/).")] = None,
    plugin: Plugins = None,
    config: Annotated[Path | None, typer.Option(help="TOML file with any of these options.")] = None,
    fresh: Annotated[bool, typer.Option(help="Set older rows of this folder aside; else the run continues.")] = False,
) -> None:
    """Run methods on protocols. The same command continues an unfinished run, also after kill -9."""
    from regbench.cli.interrupt import any_stop_as_interrupt
    from regbench.cli.progress import progress_display
    from regbench.files import write_atomically
    from regbench.report.table import render
    from regbench.runner.config import load_config
    from regbench.runner.run import run as run_trials

    given = {
        "method": method,
        "protocol": protocol,
        "limit": limit,
        "repeat": repeat,
        "seed": seed,
        "timeout": timeout,
        "memory": memory,
        "jobs": jobs,
        "threads": threads,
        "batch": batch,
        "device": device,
        "executor": executor,
        "scheduler": scheduler,
        "data": str(data) if data else None,
        "out": str(out) if out else None,
        "plugin": [str(path) for path in plugin or []],
        "fresh": fresh,
    }
    options = load_config(config, {name: value for name, value in given.items() if _is_from_user(context, name)})
    with any_stop_as_interrupt(), progress_display(sys.stderr) as progress:
        run_dir = run_trials(options, command=sys.argv, progress=progress)
    for style, suffix in (("text", "txt"), ("csv", "csv"), ("json", "json")):
        text = render([run_dir.path], format=style)
        write_atomically(run_dir.tables / f"table.{suffix}", text.encode() + b"\n")
        if style == "text":
            print(text)
    print(f"\n{run_dir.path}: rows in trials.jsonl, tables in tables/; `regbench table` prints other formats")


def _is_from_user(context: typer.Context, name: str) -> bool:
    source: Any = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
