"""Numeric arrays of HDF5 files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import check_is_file, naming
from regbench.datasets.readers.child import read_in_child
from regbench.errors import UserError

# Deflate shrinks chunks to a thousandth at best; more than that is a header that lies.
MAX_INFLATION = 1100


def read_h5_array(path: Path, key: str, index: tuple[slice, ...] = ()) -> NDArray[Any]:
    """Return the numeric array `key` of an HDF5 file, or the part of it that `index` selects.

    The HDF5 library follows damaged lengths into memory that is not its own, so it reads in a process apart.

    Raises:
        UserError: The file cannot be read, has no such array, or the array is not of finite numbers.
    """
    import h5py  # noqa: F401 - before the fork, so that it is not imported again in each

    check_is_file(path)
    return read_in_child(path, "HDF5 file", lambda: _read(path, key, index))


def _read(path: Path, key: str, index: tuple[slice, ...] = ()) -> NDArray[Any]:
    import h5py

    # h5py reports a broken file by any of these, depending on where it breaks.
    errors = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError, MemoryError)
    with naming(path, "HDF5 file", *errors), h5py.File(path, "r") as file:
        dataset = file.get(key)
        if not isinstance(dataset, h5py.Dataset):
            raise UserError(f"{path}: has no array '{key}' (it has {', '.join(file) or 'nothing'})")
        if dataset.dtype.kind not in "iuf" or dataset.shape is None or dataset.ndim == 0:
            raise UserError(f"{path}: '{key}' is not an array of numbers ({dataset.dtype})")
        stored = path.stat().st_size * (MAX_INFLATION if dataset.chunks else 1)
        if dataset.size * dataset.dtype.itemsize > stored:
            raise UserError(f"{path}: '{key}' claims shape {dataset.shape}, more than the file can hold")
        array: NDArray[Any] = dataset[index]
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise UserError(f"{path}: '{key}' has values that are not finite")
    return array
