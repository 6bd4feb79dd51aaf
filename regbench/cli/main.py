"""The entry point: verbs by name, imported when used, and one clear line for what is the user's to mend."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import typer

from regbench.cli import (
    align,
    check,
    compare,
    data,
    doctor,
    export,
    ls,
    merge,
    new,
    plot,
    report,
    reproduce,
    run,
    show,
    table,
    train,
    weights,
)
from regbench.cli.options import NamesBelow, help_without_verb
from regbench.compiled.cache import settle
from regbench.errors import UserError

DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
INTERRUPTED = 130
STOPPED = (129, INTERRUPTED, 143)  # 128 + SIGHUP, SIGINT, SIGTERM

app = typer.Typer(
    help="Point cloud registration methods, measured on named protocols.",
    callback=help_without_verb,
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

app.command("run")(run.run)
app.command("table")(table.table)
app.command("compare")(compare.compare)
app.command("export")(export.export)
app.command("merge")(merge.merge)
app.command("report")(report.report)
app.command("show")(show.show)
app.command("train")(train.train)
app.command("align")(align.align)
app.command("plot", cls=NamesBelow)(plot.plot)
app.command("reproduce", cls=NamesBelow)(reproduce.reproduce)
app.command("ls")(ls.ls)
app.command("check")(check.check)
app.command("new")(new.new)
app.command("doctor")(doctor.doctor)
app.add_typer(data.app, name="data")
app.add_typer(weights.app, name="weights")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code: 0, 1 for 'no' as an answer, 2 for bad input, 130 for Ctrl-C.

    A training that was asked to stop gives 128 and the signal's number.
    """
    settle()
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")  # a terminal that has no dagger still gets its table
    try:
        result = app(args=None if arguments is None else list(arguments), standalone_mode=False)
        sys.stdout.flush()
    except UserError as error:
        print(f"regbench: {error}", file=sys.stderr)
        return 2
    except typer.TyperException as error:
        words = error.format_message() if hasattr(error, "format_message") else str(error)
        print(f"regbench: {' '.join(words.split())} (see --help)", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, typer.Abort):
        result = INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except OSError as error:
        if error.errno not in DISK_FULL:
            raise
        print(f"regbench: {error.filename or 'standard output'}: cannot be written ({error.strerror})", file=sys.stderr)
        _drop_stdout()
        return 2
    if result in STOPPED:  # typer answers so too, where it met the interrupt first
        print("regbench: interrupted; give the same command again to continue", file=sys.stderr)
    return result if isinstance(result, int) else 0


def _drop_stdout() -> None:
    """Let what could not be written go: at its exit the interpreter would try again, and say so in lines of its own."""
    with suppress(OSError), Path(os.devnull).open("wb") as nothing:
        os.dup2(nothing.fileno(), 1)
