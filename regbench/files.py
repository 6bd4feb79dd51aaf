"""Writing files so that a reader never sees half of one."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from regbench.errors import UserError


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file under a temporary name beside it, then rename it into place.

    A link stays one, and what it points to is written; a device or a pipe is written as it stands.

    Raises:
        UserError: The disk is full, or there can be no file of that name.
    """
    write_lines_atomically(path, [content])


def write_lines_atomically(path: Path, lines: Iterable[bytes]) -> None:
    """Write lines, ends and all, as `write_atomically` does; they may be read from the file that is replaced.

    Raises:
        UserError: The disk is full, or there can be no file of that name.
    """
    if not path.name:
        raise UserError(f"'{path}' is not the name of a file to write")
    try:
        if path.exists() and not path.is_file():
            with path.open("wb") as device:
                device.writelines(lines)
            return
        _replace(Path(os.path.realpath(path)), lines)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror})") from error


def _replace(path: Path, lines: Iterable[bytes]) -> None:
    temporary = path.with_name(f".{path.name[:200]}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.writelines(lines)
        temporary.replace(path)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
        raise
