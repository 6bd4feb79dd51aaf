"""regbench data: prepare raw downloads, or fetch them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Data, NamesBelow, help_without_verb

app = typer.Typer(help="Prepare raw data, or download it.", callback=help_without_verb, invoke_without_command=True)


@app.command("prepare", cls=NamesBelow)
def prepare(
    name: Annotated[str, typer.Argument(help="The dataset, one of the names below.")],
    source: Annotated[Path, typer.Option("--from", help="Folder of the raw download.")],
    data: Data = None,
    points: Annotated[int | None, typer.Option(help="Points a cloud (else the dataset's default).")] = None,
    seed: Annotated[int, typer.Option(help="Seed of surface sampling.")] = 0,
) -> None:
    """Prepare a raw download: memory-mapped arrays and a manifest. Preparing twice changes nothing."""
    from regbench import registry
    from regbench.cli.progress import say
    from regbench.datasets.store import data_dir
    from regbench.errors import UserError

    if points is not None and points < 1:
        raise UserError(f"--points {points}: must be at least 1")
    if not source.is_dir():
        raise UserError(f"--from {source}: no such folder")
    prepare_dataset = registry.load(
        registry.PREPARATIONS, name, what="preparation", listing="`regbench data prepare --help`"
    )
    options = {} if points is None else {"points": points}
    print(prepare_dataset(source, data_dir(data), seed=seed, report=say, **options))


@app.command("get", cls=NamesBelow)
def get(name: Annotated[str, typer.Argument(help="The download, one of the names below.")], data: Data = None) -> None:
    """Download a dataset from its mirrors, check it and unpack it; then give it to `data prepare`."""
    from regbench import registry
    from regbench.cli.progress import say
    from regbench.datasets.store import data_dir

    download = registry.load(registry.DOWNLOADS, name, what="download", listing="`regbench data get --help`")
    print(download(name, data_dir(data), report=say))
