"""Arrays of .npy files. Pickled objects are never loaded."""

from __future__ import annotations

import warnings
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import check_is_file, naming
from regbench.errors import UserError

# Coordinates, normals, colours and the like; a (3, N) array is refused rather than read as three points.
MOST_COLUMNS = 16


def read_npy(path: Path) -> NDArray[Any]:
    """Return the numeric array of a .npy file, memory-mapped and read-only.

    Mapping also refuses a header that claims more than the file holds.

    Raises:
        UserError: The file cannot be read, or is not an array of numbers.
    """
    check_is_file(path)
    if path.stat().st_size == 0:
        raise UserError(f"{path}: the file is empty")
    with path.open("rb") as file:
        if file.read(6) != b"\x93NUMPY":
            raise UserError(f"{path}: not a .npy array")
    # NumPy evaluates the header as a Python literal and reports a broken one by any of these.
    errors = (OSError, ValueError, TypeError, SyntaxError, TokenError, EOFError, KeyError, OverflowError, MemoryError)
    with naming(path, ".npy array", *errors, RecursionError), warnings.catch_warnings():
        # Of headers by Python 2, which are read all the same, and of sizes that overflow, which are refused.
        warnings.simplefilter("ignore")
        array: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    if array.dtype.kind not in "iuf":
        raise UserError(f"{path}: not an array of numbers ({array.dtype})")
    return array


def read_npy_points(path: Path) -> NDArray[Any]:
    """Return the first three columns of a .npy array of shape (N, 3 to 16).

    Raises:
        UserError: As `read_npy`, or the array is of another shape.
    """
    array = read_npy(path)
    if array.ndim != 2 or not 3 <= array.shape[1] <= MOST_COLUMNS:
        raise UserError(f"{path}: expected an array of shape (N, 3), got {array.shape}")
    return array[:, :3]
