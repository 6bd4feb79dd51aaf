"""The journal of a run: append-only JSON lines, one per trial, flushed, so that kill -9 loses nothing."""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from regbench.errors import UserError

Row = dict[str, Any]


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a journal, in the order they were written; a torn last line is left out.

    Raises:
        UserError: The file cannot be read, or a line before the last is not a row.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    rows: list[Row] = []
    whole = data[: data.rfind(b"\n") + 1]
    for number, line in enumerate(whole.splitlines(), start=1):
        try:
            row = json.loads(line)
        except ValueError:
            row = None
        if not isinstance(row, dict) or not isinstance(row.get("key"), str):
            raise UserError(
                f"{path}: line {number} is not a trial; the file was damaged by something other than a run. "
                "Remove that line (its trial will run again) or start with --fresh"
            )
        rows.append(row)
    return rows


class Journal:
    """Appends rows to a journal file that no other run may write at the same time.

    Args:
        path: The file; made if missing. A torn last line (a run killed while it wrote) is cut off: its trial has
            no row and runs again.

    Raises:
        UserError: Another run holds the file, or it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.torn_bytes = 0
        try:
            self._file = path.open("a+b", buffering=0)  # a buffer would keep what a full disk refused
        except OSError as error:
            raise UserError(f"{path}: cannot be opened for writing ({error.strerror})") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise UserError(f"{path}: another run is writing to it; wait for it, or give another --out") from None
        self._cut_torn_line()

    def _cut_torn_line(self) -> None:
        self._file.seek(0)
        data = self._file.read()
        whole = data.rfind(b"\n") + 1
        self.torn_bytes = len(data) - whole
        if self.torn_bytes:
            self._file.truncate(whole)
        self._file.seek(0, os.SEEK_END)

    def append(self, row: Row) -> None:
        """Write one row and hand it to the operating system.

        Raises:
            UserError: The disk is full or the file cannot be written. Rows written before are whole.
        """
        line = memoryview(json.dumps(row, allow_nan=False, separators=(",", ":")).encode() + b"\n")
        whole = self._file.seek(0, os.SEEK_END)
        try:
            while line:
                line = line[self._file.write(line) :]  # a nearly full disk takes a part
        except OSError as error:
            self._file.truncate(whole)
            raise UserError(
                f"{self.path}: cannot be written ({error.strerror}); every finished trial is in it. "
                "Make room and give the same command again: it continues"
            ) from error

    def close(self) -> None:
        """Close the file; the lock goes with it."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
