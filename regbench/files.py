"""Writing files so that a reader never sees half of one."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from regbench.errors import UserError


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file under a temporary name beside it, then rename it into place.

    Raises:
        UserError: The disk is full or the folder cannot be written.
    """
    write_lines_atomically(path, [content])


def write_lines_atomically(path: Path, lines: Iterable[bytes]) -> None:
    """Write lines, ends and all, as `write_atomically` does; they may be read from the file that is replaced.

    Raises:
        UserError: The disk is full or the folder cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.writelines(lines)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise UserError(f"{path}: cannot be written ({error.strerror})") from error
