"""The log of a training: log.csv, a row for every few steps, and losses.png."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from regbench.errors import UserError
from regbench.files import write_atomically

FIRST_COLUMNS = ("step", "seconds", "learning_rate")
LOSS, VALIDATION = "loss.", "validation."


class TrainingLog:
    """Rows of numbers in a CSV file; a row has a cell for what was measured at its step.

    Args:
        path: The file. What it holds is kept up to step `until`; later rows are of steps that are done again.
        until: Step at which the training continues.

    Raises:
        UserError: The file is not such a log.
    """

    def __init__(self, path: Path, until: int = 0) -> None:
        self._path = path
        self.rows = [row for row in _read(path) if row["step"] <= until]
        self._columns = _columns(self.rows)
        self._write()

    def add(self, row: Mapping[str, float]) -> None:
        """Append a row. A new column, such as a first validation's, rewrites the file."""
        self.rows.append(dict(row))
        columns = _columns(self.rows[-1:], self._columns)
        if columns != self._columns:
            self._columns = columns
            self._write()
            return
        with self._path.open("a", newline="") as file:
            self._writer(file).writerow(_cells(row))

    def _write(self) -> None:
        text = io.StringIO()
        writer = self._writer(text)
        writer.writeheader()
        writer.writerows(_cells(row) for row in self.rows)
        write_atomically(self._path, text.getvalue().encode())

    def _writer(self, file: TextIO) -> csv.DictWriter[str]:
        return csv.DictWriter(file, self._columns, restval="", lineterminator="\n")


def _columns(rows: list[dict[str, float]], known: tuple[str, ...] = FIRST_COLUMNS) -> tuple[str, ...]:
    """Return the columns in order: the first ones, losses, figures of the validation."""
    names = dict.fromkeys([*known, *(name for row in rows for name in row)])
    return tuple(sorted(names, key=lambda name: name.startswith(LOSS) + 2 * name.startswith(VALIDATION)))


def _cells(row: Mapping[str, float]) -> dict[str, str]:
    return {name: str(value) if name == "step" else f"{value:.6g}" for name, value in row.items()}


def _read(path: Path) -> list[dict[str, float]]:
    if not path.exists():
        return []
    try:
        text = path.read_text()
        whole = text[: text.rfind("\n") + 1]  # kill -9 may leave half a row at the end; its step is done again
        return [_numbers(row) for row in csv.DictReader(io.StringIO(whole))]
    except (OSError, ValueError, TypeError, AttributeError, KeyError) as error:
        raise UserError(f"{path}: is not a training's log ({error}); move it away") from error


def _numbers(row: Mapping[str, str]) -> dict[str, float]:
    return {"step": int(row["step"]), **{name: float(cell) for name, cell in row.items() if cell and name != "step"}}
