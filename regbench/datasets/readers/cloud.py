"""One cloud from one file, and back, whatever the format."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import checked_points
from regbench.datasets.readers.npy import read_npy_points
from regbench.datasets.readers.off import read_off
from regbench.datasets.readers.pcd import read_pcd
from regbench.datasets.readers.ply import read_ply
from regbench.datasets.readers.xyz import read_xyz
from regbench.errors import UserError


def _read_npy(path: Path, *, drop_invalid: bool = False) -> NDArray[np.float64]:
    return checked_points(path, read_npy_points(path), drop_invalid=drop_invalid)


def _read_off(path: Path, *, drop_invalid: bool = False) -> NDArray[np.float64]:
    return checked_points(path, read_off(path).vertices, drop_invalid=drop_invalid)


READERS = {
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".off": _read_off,
    ".npy": _read_npy,
    ".xyz": read_xyz,
    ".txt": read_xyz,
}
WRITABLE = (".ply", ".npy", ".xyz", ".txt")


def read_cloud(path: Path, *, drop_invalid: bool = False) -> NDArray[np.float64]:
    """Return the points of a cloud file, (N, 3) float64; the suffix says the format.

    Args:
        path: A .ply, .pcd, .off (its vertices), .npy, .xyz or .txt file.
        drop_invalid: Leave out points that are not finite, as sensors write them, rather than refuse the file.

    Raises:
        UserError: The file cannot be read as what its suffix says, or its points are not finite.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise UserError(f"{path}: unknown format '{path.suffix}', expected one of {', '.join(READERS)}")
    with np.errstate(invalid="ignore"):  # NumPy warns of a signalling NaN it converts; what is not finite is told of
        return reader(path, drop_invalid=drop_invalid)


def check_writable(path: Path) -> None:
    """Raise UserError unless `write_cloud` knows the file's format: for a check before long work.

    Raises:
        UserError: The suffix is not one that can be written, or the folder does not exist.
    """
    if path.suffix.lower() not in WRITABLE:
        raise UserError(f"{path}: cannot write '{path.suffix}', expected one of {', '.join(WRITABLE)}")
    if not path.parent.is_dir():
        raise UserError(f"{path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise UserError(f"{path}: is a folder, expected a file")


def write_cloud(path: Path, points: NDArray[np.float64]) -> None:
    """Write (N, 3) points as float64: binary .ply, .npy, or text (.xyz, .txt). An existing file is replaced.

    Raises:
        UserError: As `check_writable`, or the file cannot be written.
    """
    check_writable(path)
    suffix = path.suffix.lower()
    values = np.ascontiguousarray(points, dtype="<f8")
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        with partial.open("wb") as file:
            if suffix == ".npy":
                np.lib.format.write_array(file, values, allow_pickle=False)
            elif suffix == ".ply":
                properties = "".join(f"property double {axis}\n" for axis in "xyz")
                header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(values)}\n{properties}end_header\n"
                file.write(header.encode() + values.tobytes())
            else:
                np.savetxt(file, values, fmt="%.17g")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from None
