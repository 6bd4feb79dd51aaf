"""The journal of a run: append-only JSON lines, one per trial, flushed, so that kill -9 loses nothing."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from regbench.errors import UserError
from regbench.json_lines import parse_json

Row = dict[str, Any]


# How much of a journal's end is looked at in one go for its last whole line.
CHUNK_BYTES = 65536


def rows_in(path: Path) -> Iterator[Row]:
    """Yield the rows of a journal, one in memory at a time, in the order written; a torn last line is left out.

    Raises:
        UserError: The file cannot be read, or a line before the last is not a row.
    """
    try:
        with path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                if line.endswith(b"\n"):
                    yield _row(path, number, line)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); is this the folder of a run?") from error


def read_rows(path: Path) -> list[Row]:
    """Return all rows of a journal, as `rows_in` yields them: some 3 kB each, so not for what may be a million.

    Raises:
        UserError: As `rows_in`.
    """
    return list(rows_in(path))


def _row(path: Path, number: int, line: bytes) -> Row:
    try:
        row = parse_json(line)
    except ValueError:
        row = None
    if not isinstance(row, dict) or not isinstance(row.get("key"), str):
        raise UserError(
            f"{path}: line {number} is not a trial; the file was damaged by something other than a run. "
            "Remove that line (its trial will run again) or start with --fresh"
        )
    return row


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
        size = end = self._file.seek(0, os.SEEK_END)
        whole = 0
        while end > 0:  # from the end: a journal may be larger than memory
            start = max(0, end - CHUNK_BYTES)
            self._file.seek(start)
            newline = self._file.read(end - start).rfind(b"\n")
            if newline >= 0:
                whole = start + newline + 1
                break
            end = start
        self.torn_bytes = size - whole
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
