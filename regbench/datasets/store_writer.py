"""Writes a prepared dataset: into a temporary sibling folder, then renamed into place, whole or not at all."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.dataset import Split
from regbench.datasets.store import (
    DTYPES,
    FORMAT,
    MANIFEST,
    content_sha256,
    file_sha256,
    open_prepared,
)
from regbench.errors import UserError


def write_dataset(
    data_dir: Path,
    name: str,
    *,
    description: str,
    label_names: Sequence[str],
    splits: Mapping[str, Split],
    options: Mapping[str, object],
    left_out: Mapping[str, str],
    remarks: Mapping[str, str],
) -> bool:
    """Write DATA_DIR/<name>/ and return whether anything changed: the same content again changes nothing.

    An earlier preparation of the same name is replaced only once the new one is complete. What an interrupted
    attempt left is cleaned up here.

    Args:
        data_dir: Folder of prepared datasets; made if missing.
        name: The dataset's name.
        description: One line on the source.
        label_names: Category or scene names, which the labels index.
        splits: By name.
        options: What the preparation was asked for (points, seed).
        left_out: Items of the source that are not in the dataset, with the reason.
        remarks: Items that are in the dataset although something is odd about them, with what.

    Raises:
        UserError: The folder cannot be written, or another preparation of it is running.
        ValueError: The splits do not fit together.
    """
    for split_name, split in splits.items():
        _check_split(split_name, split, len(label_names))
    final, staging, previous = data_dir / name, data_dir / f".{name}.preparing", data_dir / f".{name}.previous"
    try:
        data_dir.mkdir(parents=True, exist_ok=True)
        with _locked(data_dir):
            _clean_up(final, staging, previous)
            staging.mkdir()
            try:
                files = _write_splits(staging, splits)
                manifest = {
                    "format": FORMAT,
                    "name": name,
                    "description": description,
                    "label_names": list(label_names),
                    "splits": {split_name: len(split) for split_name, split in splits.items()},
                    "options": dict(options),
                    "left_out": dict(sorted(left_out.items())),
                    "remarks": dict(sorted(remarks.items())),
                    "files": files,
                    "sha256": content_sha256(list(label_names), files),
                }
                text = json.dumps(manifest, indent=1, ensure_ascii=False) + "\n"
                _write(staging / MANIFEST, text)
                if _is_same(final, text):
                    return False
                if final.exists():
                    final.rename(previous)
                staging.rename(final)
            finally:
                shutil.rmtree(staging, ignore_errors=True)
            shutil.rmtree(previous, ignore_errors=True)
    except OSError as error:
        raise UserError(f"cannot write dataset {name} in {data_dir}: {error.strerror or error}") from error
    return True


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the folder's lock, which the kernel drops however the process ends."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UserError(f"{folder}: another preparation is writing there; wait for it to end") from None
    else:
        yield
    finally:
        os.close(handle)


def _clean_up(final: Path, staging: Path, previous: Path) -> None:
    """Undo what an interrupted attempt left; between the two renames only `previous` is whole."""
    shutil.rmtree(staging, ignore_errors=True)
    if previous.exists() and not final.exists():
        previous.rename(final)
    shutil.rmtree(previous, ignore_errors=True)


def _is_same(folder: Path, manifest_text: str) -> bool:
    """Say whether the folder holds exactly this manifest and every file is what it says."""
    path = folder / MANIFEST
    if not path.is_file() or path.read_bytes() != manifest_text.encode():
        return False
    try:
        open_prepared(folder.parent, folder.name, verify=True)
    except UserError:
        return False
    return True


def _write_splits(folder: Path, splits: Mapping[str, Split]) -> dict[str, dict[str, Any]]:
    files: dict[str, dict[str, Any]] = {}
    for split_name, split in splits.items():
        arrays: dict[str, NDArray[Any] | None] = {"points": split.points, "labels": split.labels, "poses": split.poses}
        for kind, array in arrays.items():
            if array is None:
                continue
            path = folder / f"{split_name}_{kind}.npy"
            with path.open("wb") as file:
                np.lib.format.write_array(file, np.ascontiguousarray(array, DTYPES[kind]), (1, 0), allow_pickle=False)
                _flush(file)
            files[path.name] = {**_entry(path), "shape": list(array.shape)}
        path = folder / f"{split_name}_ids.txt"
        _write(path, "".join(f"{id}\n" for id in split.ids))
        files[path.name] = _entry(path)
    return files


def _write(path: Path, text: str) -> None:
    with path.open("wb") as file:
        file.write(text.encode())
        _flush(file)


def _flush(file: IO[bytes]) -> None:
    """Put a file's bytes on the disk before the rename that makes it count."""
    file.flush()
    os.fsync(file.fileno())


def _entry(path: Path) -> dict[str, Any]:
    return {"bytes": path.stat().st_size, "sha256": file_sha256(path)}


def _check_split(name: str, split: Split, label_count: int) -> None:
    count = len(split.points)
    if split.points.ndim != 3 or split.points.shape[2] != 3 or split.labels.shape != (count,):
        raise ValueError(f"split '{name}': points {split.points.shape} and labels {split.labels.shape} do not fit")
    if len(split.ids) != count or len(set(split.ids)) != count or any("\n" in id for id in split.ids):
        raise ValueError(f"split '{name}': needs {count} different ids, each one line")
    if split.poses is not None and split.poses.shape != (count, 4, 4):
        raise ValueError(f"split '{name}': poses {split.poses.shape} do not fit {count} clouds")
    if count and not (split.labels.min() >= 0 and split.labels.max() < label_count):
        raise ValueError(f"split '{name}': labels outside 0..{label_count - 1}")
    if not np.isfinite(split.points).all():
        raise ValueError(f"split '{name}': points that are not finite")
