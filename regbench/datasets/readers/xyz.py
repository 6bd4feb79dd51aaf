"""Points of plain text: three numbers or more a line, separated by blanks or commas; `#` starts a comment."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import checked_points, read_bytes
from regbench.datasets.readers.numbers import parse_numbers
from regbench.errors import UserError


def read_xyz(path: Path, *, drop_invalid: bool = False) -> NDArray[np.float64]:
    """Return the first three columns, (N, 3) float64.

    Raises:
        UserError: The file cannot be read, its lines differ in length, or a point is not three finite numbers.
    """
    content = re.sub(rb"#[^\n]*", b"", read_bytes(path)).replace(b",", b" ")
    lines = [line for line in content.split(b"\n") if line.strip()]
    if not lines:
        raise UserError(f"{path}: holds no points")
    columns = len(lines[0].split())
    numbers = parse_numbers(path, b"\n".join(lines))
    if columns < 3:
        raise UserError(f"{path}: its lines have {columns} numbers, a point has three")
    if len(numbers) != columns * len(lines):
        raise UserError(f"{path}: not every line has {columns} numbers, as the first has")
    return checked_points(path, numbers.reshape(-1, columns)[:, :3], drop_invalid=drop_invalid)
