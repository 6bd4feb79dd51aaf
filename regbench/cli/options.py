"""What several verbs share: options, and the help where none is named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

Methods = Annotated[list[str], typer.Option("--method", "-m", help="Methods, e.g. icp,fgr[preset=paper].")]
Data = Annotated[Path | None, typer.Option("--data", help="Folder of prepared data (or REGBENCH_DATA; else ./data).")]
Plugins = Annotated[list[Path] | None, typer.Option("--plugin", help="Python file with methods; may be repeated.")]
Json = Annotated[bool, typer.Option("--json", help="JSON instead of text.")]


class NamesBelow(TyperCommand):
    """A verb whose help ends with the names installed for it; looked up only then, since it takes time."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the names."""
        from regbench import registry
        from regbench.report.figures import FIGURES

        group = {
            "prepare": registry.PREPARATIONS,
            "get": registry.DOWNLOADS,
            "plot": registry.PLOTS,
            "reproduce": registry.REPRODUCTIONS,
        }[self.name or ""]
        built_in = FIGURES if self.name == "plot" else ()
        formatter.write(f"\nNames: {', '.join([*built_in, *registry.names(group)])}.\n")


def refuse_given(context: typer.Context, names: Sequence[str], words: str) -> None:
    """Raise UserError if one of these options is on the command line: it would be of no effect."""
    from regbench.errors import UserError

    for parameter in context.command.params:
        source: Any = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not None and source.name == "COMMANDLINE":
            raise UserError(f"{parameter.opts[0]} {words}")


def help_without_verb(context: typer.Context) -> None:
    """Print the help where no verb is given: the callback of a group."""
    if context.invoked_subcommand is None:
        print(context.get_help())
