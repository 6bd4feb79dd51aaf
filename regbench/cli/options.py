"""What several verbs share: options, and the help where none is named."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Methods = Annotated[list[str], typer.Option("--method", "-m", help="Methods, e.g. icp,fgr[preset=paper].")]
Data = Annotated[Path | None, typer.Option("--data", help="Folder of prepared data (or REGBENCH_DATA; else ./data).")]
Plugins = Annotated[list[Path] | None, typer.Option("--plugin", help="Python file with methods; may be repeated.")]
Json = Annotated[bool, typer.Option("--json", help="JSON instead of text.")]


def help_without_verb(context: typer.Context) -> None:
    """Print the help where no verb is given: the callback of a group."""
    if context.invoked_subcommand is None:
        print(context.get_help())
