"""4x4 transforms in text files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import read_bytes
from regbench.errors import UserError


def read_transform(path: Path) -> NDArray[np.float64]:
    """Return the (4, 4) float64 matrix of a text file: sixteen numbers, row by row, the last row 0 0 0 1.

    The rotation is returned as it stands; whether it is orthonormal enough is for the caller to say.

    Raises:
        UserError: The file cannot be read, or holds anything but such a matrix.
    """
    try:
        numbers = [float(word) for word in read_bytes(path).decode("ascii").replace(",", " ").split()]
    except ValueError as error:  # also UnicodeDecodeError
        raise UserError(f"{path}: not a 4x4 matrix of numbers ({' '.join(str(error).split())[:100]})") from None
    if len(numbers) != 16:
        raise UserError(f"{path}: a 4x4 matrix has 16 numbers, this file has {len(numbers)}")
    matrix = np.array(numbers).reshape(4, 4)
    if not np.isfinite(matrix).all():
        raise UserError(f"{path}: the matrix has values that are not finite")
    if np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-6:
        raise UserError(f"{path}: the last row of the matrix is not 0 0 0 1")
    return matrix
