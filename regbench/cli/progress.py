"""How a run shows itself: a live display on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TextIO

from regbench.runner.run import Tally
from regbench.runner.rundir import RunDir
from regbench.runner.status import COLOUR, Status

LINE_INTERVAL_S = 10.0


@contextmanager
def progress_display(stream: TextIO) -> Iterator[PlainProgress | LiveProgress]:
    """Yield the display that fits the stream."""
    if not stream.isatty():
        yield PlainProgress(stream)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[failures]}"),
    )
    with Progress(*columns, console=Console(file=stream), refresh_per_second=4) as bars:
        yield LiveProgress(bars)


class PlainProgress:
    """One line at the start, one every ten seconds, and one for the first failure of each kind."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._seen: Counter[tuple[str, str]] = Counter()

    def start(self, run: RunDir, trials: Mapping[str, Tally]) -> None:
        """Say where the run is and how much there is to do."""
        self._total = sum(tally.total for tally in trials.values())
        self._done = sum(tally.done for tally in trials.values())
        self._last = time.monotonic()
        resumed = f", {self._done} of them done before" if self._done else ""
        self._say(f"run {run.path}: {self._total} trials{resumed}")

    def row(self, row: dict[str, Any]) -> None:
        """Count a trial."""
        self._done += 1
        if row["status"] != Status.OK:
            self._seen[row["method"], row["status"]] += 1
            if self._seen[row["method"], row["status"]] == 1:
                where = f"{row['method']} on {row['protocol']}, problem {row['problem']}"
                self._say(f"{row['status']}: {where}: {row['error']} (further ones are counted in the table)")
        if time.monotonic() - self._last > LINE_INTERVAL_S:
            self._last = time.monotonic()
            self._say(f"{self._done} of {self._total} trials, at {row['method']} on {row['protocol']}")

    def note(self, message: str) -> None:
        """Print a message."""
        self._say(message)

    def _say(self, message: str) -> None:
        print(message, file=self._stream, flush=True)


class LiveProgress:
    """One bar for each method."""

    def __init__(self, bars: Any) -> None:
        self._bars = bars
        self._tasks: dict[str, Any] = {}
        self._failures: dict[str, Counter[str]] = {}

    def start(self, run: RunDir, trials: Mapping[str, Tally]) -> None:
        """Say where the run is and draw the bars."""
        from rich.markup import escape

        self._bars.console.print(f"run {run.path}", markup=False, highlight=False)
        for method, tally in trials.items():
            self._failures[method] = Counter()
            self._tasks[method] = self._bars.add_task(
                escape(method), total=tally.total, completed=tally.done, failures=""
            )

    def row(self, row: dict[str, Any]) -> None:
        """Move a bar on."""
        method = row["method"]
        if row["status"] != Status.OK:
            self._failures[method][row["status"]] += 1
        words = " ".join(f"[{COLOUR[Status(s)]}]{n} {s}[/]" for s, n in self._failures[method].items())
        self._bars.update(self._tasks[method], advance=1, failures=words)

    def note(self, message: str) -> None:
        """Print a message above the bars."""
        self._bars.console.print(message, markup=False, highlight=False)


def say(message: str) -> None:
    """Print a line of progress to stderr, so that stdout holds results alone."""
    print(message, file=sys.stderr, flush=True)
