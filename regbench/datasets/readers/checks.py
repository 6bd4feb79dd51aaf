"""What every reader checks, in one wording."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.errors import UserError


def read_bytes(path: Path) -> bytes:
    """Return a file's bytes.

    Raises:
        UserError: It is missing, a folder, empty or cannot be read.
    """
    check_is_file(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror or error})") from None
    if not content:
        raise UserError(f"{path}: the file is empty")
    return content


def check_is_file(path: Path) -> None:
    """Raise UserError unless the path is a file."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:  # a name that is too long, or holds a zero byte
        raise UserError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if stat.S_ISDIR(mode):
        raise UserError(f"{path}: is a folder, expected a file")
    if not stat.S_ISREG(mode):
        raise UserError(f"{path}: is not a regular file")


@contextmanager
def naming(path: Path, kind: str, *errors: type[Exception]) -> Iterator[None]:
    """Turn a library's errors about a file into a UserError: `<path>: not a readable <kind> (<reason>)`."""
    try:
        yield
    except errors as error:
        raise UserError(f"{path}: not a readable {kind} ({one_line(error)})") from None


def one_line(error: Exception, limit: int = 200) -> str:
    """Return an error's message on one line, or its type where it has none."""
    return (" ".join(str(error).split()) or type(error).__name__)[:limit]


def checked_points(path: Path, points: NDArray[Any], *, drop_invalid: bool = False) -> NDArray[np.float64]:
    """Return (N, 3) points as float64, or without the rows that are not finite if `drop_invalid`.

    Raises:
        UserError: There are none, they are not finite, or they do not have three columns.
    """
    if points.ndim != 2 or points.shape[1] != 3:
        raise UserError(f"{path}: expected points of shape (N, 3), got {points.shape}")
    values = np.ascontiguousarray(points, dtype=np.float64)
    finite = np.isfinite(values).all(axis=1)
    if not finite.all():
        if not drop_invalid:
            bad = len(values) - int(finite.sum())
            raise UserError(f"{path}: {bad} of {len(values)} points are not finite (NaN or infinite)")
        values = values[finite]
    if len(values) == 0:
        raise UserError(f"{path}: holds no points")
    return values
