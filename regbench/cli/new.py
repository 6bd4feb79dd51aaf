"""regbench new: a plugin package that already passes `check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer


def new(
    what: Annotated[Literal["method"], typer.Argument(help="What to make.")],
    name: Annotated[str, typer.Argument(help="Its name, e.g. my_icp.")],
    folder: Annotated[Path | None, typer.Option(help="Where to make it (else ./NAME).")] = None,
) -> None:
    """Write a small package with a working method, its test and its entry point."""
    from regbench.testing.template import write_method_package

    for path in write_method_package(name, folder or Path(name)):
        print(path)
