"""Prepared datasets on disk: DATA_DIR/<name>/ holds memory-mapped .npy arrays and manifest.json.

Per split: `<split>_points.npy` (S, P, 3) float32, `<split>_labels.npy` (S,) int64, `<split>_ids.txt` one id a line,
and where there are camera poses `<split>_poses.npy` (S, 4, 4) float64. Writing is in `store_writer`.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.dataset import Dataset, Split
from regbench.datasets.readers.npy import read_npy
from regbench.errors import UserError

FORMAT = 1
MANIFEST = "manifest.json"
DTYPES = {"points": "float32", "labels": "int64", "poses": "float64"}


def data_dir(option: Path | None) -> Path:
    """Return the folder of prepared datasets: the option, else the environment's REGBENCH_DATA, else ./data."""
    if option is not None:
        return option
    return Path(os.environ.get("REGBENCH_DATA") or "data")


def open_modelnet40(data_dir: Path) -> Dataset:
    """Open the prepared ModelNet40: splits "train" and "test"."""
    return open_prepared(data_dir, "modelnet40")


def open_7scenes(data_dir: Path) -> Dataset:
    """Open the prepared 7-Scenes: one split "scans", in metres and the camera's frame, with poses."""
    return open_prepared(data_dir, "7scenes")


def open_prepared(data_dir: Path, name: str, *, verify: bool = False) -> Dataset:
    """Open a prepared dataset, its arrays memory-mapped and read-only.

    Every array's shape, type and size is checked against the manifest; with `verify` every byte is hashed too.

    Raises:
        UserError: The dataset is not prepared in `data_dir`, or its files are not what the manifest says.
    """
    folder = data_dir / name
    if not (folder / MANIFEST).is_file():
        raise UserError(
            f"dataset {name} is not prepared in {data_dir}; "
            f"run `regbench data prepare {name} --from FOLDER --data {data_dir}`"
        )
    manifest = read_manifest(folder)
    for file, entry in manifest["files"].items():
        _check_file(folder / file, entry, verify=verify)
    splits = {split: _open_split(folder, split, manifest) for split in manifest["splits"]}
    return Dataset(name, manifest["label_names"], splits, manifest["sha256"], manifest["description"])


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a prepared dataset's folder.

    Raises:
        UserError: It cannot be read, is of another format version, or lacks what it must have.
    """
    path = folder / MANIFEST
    try:
        manifest = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{path}: cannot be read ({_one_line(error)}); {_again(folder)}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise UserError(f"{path}: not a manifest of format {FORMAT}; {_again(folder)}")
    expected = {"name": str, "description": str, "sha256": str, "label_names": list, "splits": dict, "files": dict}
    for key, kind in expected.items():
        if not isinstance(manifest.get(key), kind):
            raise UserError(f"{path}: '{key}' is missing or not a {kind.__name__}; {_again(folder)}")
    if not all(isinstance(entry, dict) for entry in manifest["files"].values()):
        raise UserError(f"{path}: 'files' does not describe each file; {_again(folder)}")
    if manifest["sha256"] != content_sha256(manifest["label_names"], manifest["files"]):
        raise UserError(f"{path}: its sha256 is not that of its files' hashes; {_again(folder)}")
    return manifest


def content_sha256(label_names: list[str], files: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a dataset's identity: the SHA-256 over its label names and its files' names and hashes."""
    content = {"label_names": label_names, "files": {name: entry.get("sha256") for name, entry in files.items()}}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_file(path: Path, entry: Mapping[str, Any], *, verify: bool) -> None:
    if not path.is_file():
        raise UserError(f"{path}: missing; {_again(path.parent)}")
    if path.stat().st_size != entry.get("bytes"):
        raise UserError(
            f"{path}: has {path.stat().st_size} bytes, the manifest says {entry.get('bytes')}; {_again(path.parent)}"
        )
    if verify and file_sha256(path) != entry.get("sha256"):
        raise UserError(f"{path}: its SHA-256 is not the manifest's; {_again(path.parent)}")


def _open_split(folder: Path, split: str, manifest: Mapping[str, Any]) -> Split:
    files = manifest["files"]
    points = _open_array(folder / f"{split}_points.npy", files)
    labels = _open_array(folder / f"{split}_labels.npy", files)
    poses = _open_array(folder / f"{split}_poses.npy", files) if f"{split}_poses.npy" in files else None
    ids = _read_ids(folder / f"{split}_ids.txt")
    if not len(points) == len(labels) == len(ids) == len(ids if poses is None else poses):
        raise UserError(f"{folder}: the arrays of split '{split}' differ in length; {_again(folder)}")
    return Split(points, labels, ids, poses)


def _read_ids(path: Path) -> list[str]:
    try:
        # Not splitlines: an id may hold what Unicode calls a line's end.
        return path.read_bytes().decode("utf-8").split("\n")[:-1]
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read ({_one_line(error)}); {_again(path.parent)}") from None


def _open_array(path: Path, files: Mapping[str, Mapping[str, Any]]) -> NDArray[Any]:
    entry = files.get(path.name, {})
    try:
        array = read_npy(path)
    except UserError as error:
        raise UserError(f"{error}; {_again(path.parent)}") from None
    dtype = DTYPES[path.stem.rpartition("_")[2]]
    if list(array.shape) != entry.get("shape") or array.dtype != np.dtype(dtype):
        raise UserError(
            f"{path}: holds {array.dtype} of shape {array.shape}, "
            f"the manifest says {dtype} of {entry.get('shape')}; {_again(path.parent)}"
        )
    return array


def _again(folder: Path) -> str:
    return f"prepare it again: `regbench data prepare {folder.name} --from FOLDER --data {folder.parent}`"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
