"""How a training shows itself: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TextIO

LINE_INTERVAL_S = 30.0


@contextmanager
def training_display(stream: TextIO) -> Iterator[PlainTraining | LiveTraining]:
    """Yield the display that fits the stream."""
    if not stream.isatty():
        yield PlainTraining(stream)
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
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}", markup=False),
    )
    with Progress(*columns, console=Console(file=stream), refresh_per_second=4) as bars:
        yield LiveTraining(bars)


class PlainTraining:
    """One line at the start, one for each validation, and one every half minute."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._last = time.monotonic()

    def start(self, folder: Any, done: int, total: int) -> None:
        """Say where the training is and how much there is to do."""
        self._total = total
        self._say(_start_words(folder, done, total))

    def step(self, done: int, total: int) -> None:
        """Say nothing: rows speak."""

    def row(self, row: Mapping[str, float]) -> None:
        """Print a row that holds a validation, or comes long after the last line."""
        is_validation = any(name.startswith("validation.") for name in row)
        if is_validation or time.monotonic() - self._last > LINE_INTERVAL_S:
            self._last = time.monotonic()
            self._say(f"step {int(row['step'])} of {self._total}: {_row_words(row)}")

    def _say(self, message: str) -> None:
        print(message, file=self._stream, flush=True)


class LiveTraining:
    """A bar with the newest figures beside it."""

    def __init__(self, bars: Any) -> None:
        self._bars = bars
        self._words: dict[str, float] = {}

    def start(self, folder: Any, done: int, total: int) -> None:
        """Draw the bar."""
        self._bars.console.print(_start_words(folder, done, total), markup=False, highlight=False)
        self._task = self._bars.add_task("", total=total, completed=done)

    def step(self, done: int, total: int) -> None:
        """Move the bar on."""
        self._bars.update(self._task, completed=done)

    def row(self, row: Mapping[str, float]) -> None:
        """Show the newest figures."""
        self._words |= row
        self._bars.update(self._task, description=_row_words(self._words))


def _start_words(folder: Any, done: int, total: int) -> str:
    return f"training {folder.path}: {total} steps" + (f", {done} of them done before" if done else "")


def _row_words(row: Mapping[str, float]) -> str:
    shown = {name: value for name, value in row.items() if name == "loss.total" or name.startswith("validation.")}
    return ", ".join(f"{name.removeprefix('validation.')} {value:.4g}" for name, value in shown.items())
