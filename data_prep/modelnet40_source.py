"""The three layouts in which ModelNet40 is found on a disk, each read into clouds per split."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import checked_points, naming, read_bytes
from regbench.datasets.readers.h5 import read_h5_array
from regbench.datasets.readers.npy import read_npy_points
from regbench.datasets.readers.off import read_off
from regbench.datasets.surface import to_unit_sphere
from regbench.errors import UserError

from .outcome import reason
from .seeds import item_generator

SPLITS = ("train", "test")
_Reader = Callable[[Path, int, np.random.Generator], NDArray[np.float64]]


@dataclass(eq=False)
class Shapes:
    """What was read, per split: clouds, categories and ids (<category>/<split>/<name>); and what was left out."""

    description: str
    points: dict[str, NDArray[np.float32]] = field(default_factory=dict)
    categories: dict[str, list[str]] = field(default_factory=dict)
    ids: dict[str, list[str]] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)


def read_source(source: Path, points: int, seed: int) -> Shapes:
    """Read whichever layout `source` is of, or a folder up to two below it (archives have a folder of their own).

    Raises:
        UserError: It is none of the three, or a file of the HDF5 pack is broken.
    """
    if not source.is_dir():
        raise UserError(f"{source}: no such folder")
    below = (path for depth in ("*", "*/*") for path in sorted(source.glob(depth)))
    for folder in (source, *(path for path in below if path.is_dir() and not _is_clutter(path))):
        if any(folder.glob("ply_data_*.h5")):
            return _read_pack(folder, points)
        if _has_tree(folder, ".off"):
            return _read_tree(folder, "tree of .off meshes, sampled by area", ".off", _sample_off, points, seed)
        if _has_tree(folder, ".npy"):
            return _read_tree(folder, "tree of .npy clouds", ".npy", _draw_npy, points, seed)
    raise UserError(
        f"{source}: not a ModelNet40 folder; expected <category>/<train|test>/<id>.off, the same with .npy, "
        "or ply_data_{train,test}N.h5"
    )


def _has_tree(folder: Path, suffix: str) -> bool:
    return any(any(folder.glob(f"*/{split}/*{suffix}")) for split in SPLITS)


def _is_clutter(path: Path) -> bool:
    """Say whether a path is hidden or of macOS's shadow files, which zips made there carry."""
    return path.name.startswith(".") or "__MACOSX" in path.parts


def _read_tree(folder: Path, layout: str, suffix: str, read: _Reader, points: int, seed: int) -> Shapes:
    """Read <category>/<split>/<name><suffix>, sorted by category and name; what cannot be used is left out."""
    shapes = Shapes(f"ModelNet40 (Princeton), {layout}")
    for split in SPLITS:
        clouds, ids = [], []
        for path in sorted(folder.glob(f"*/{split}/*{suffix}")):
            if _is_clutter(path):
                continue
            shape_id = path.relative_to(folder).with_suffix("").as_posix()
            try:
                cloud = read(path, points, item_generator(seed, shape_id))
            except UserError as error:
                shapes.left_out[shape_id] = reason(error, path.parent)
            except ValueError as error:  # a surface without area, or all points one
                shapes.left_out[shape_id] = f"{path.name}: {error}"
            else:
                clouds.append(cloud.astype(np.float32))
                ids.append(shape_id)
        if ids:
            shapes.points[split], shapes.ids[split] = np.stack(clouds), ids
            shapes.categories[split] = [shape_id.split("/")[0] for shape_id in ids]
    return shapes


def _sample_off(path: Path, points: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw points by area on a mesh, scaled to the unit sphere by the points drawn, as the HDF5 packs are."""
    from .mesh_sampling import sample_mesh  # numba takes a second to import, and only meshes need it

    mesh = read_off(path)
    if len(mesh.faces) == 0:
        raise UserError(f"{path}: the mesh has no faces")
    return to_unit_sphere(sample_mesh(mesh.vertices, mesh.faces, points, rng))


def _draw_npy(path: Path, points: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw points of a cloud without replacement, scaled to the unit sphere by the whole cloud."""
    cloud = checked_points(path, read_npy_points(path))
    if len(cloud) < points:
        raise UserError(f"{path}: has {len(cloud)} points, {points} wanted")
    # Drawn, not cut off: clouds found on disks are often ordered (by farthest points, by face).
    return rng.permutation(to_unit_sphere(cloud))[:points]


def _read_pack(folder: Path, points: int) -> Shapes:
    """Read ply_data_{split}N.h5; the first `points` of each shape, unchanged, since the packs are in random order."""
    names = _shape_names(folder)
    shapes = Shapes("ModelNet40 (Princeton), pack of HDF5 files (PointNet's layout)")
    for split in SPLITS:
        numbered = sorted(
            (int(match[1]), path)
            for path in folder.glob(f"ply_data_{split}*.h5")
            if (match := re.fullmatch(rf"ply_data_{split}(\d+)\.h5", path.name))
        )
        parts = [_read_pack_file(path, split, number, points, names) for number, path in numbered]
        if parts:
            shapes.points[split] = np.concatenate([part[0] for part in parts])
            shapes.categories[split] = [category for part in parts for category in part[1]]
            shapes.ids[split] = [shape_id for part in parts for shape_id in part[2]]
    return shapes


def _read_pack_file(
    path: Path, split: str, number: int, points: int, names: list[str]
) -> tuple[NDArray[np.float32], list[str], list[str]]:
    clouds = read_h5_array(path, "data", (slice(None), slice(points)))
    labels = read_h5_array(path, "label").ravel()
    if clouds.ndim != 3 or clouds.shape[2] != 3 or len(labels) != len(clouds):
        raise UserError(f"{path}: 'data' {clouds.shape} and 'label' ({len(labels)},) are not a pack's")
    if clouds.shape[1] < points:
        raise UserError(f"{path}: has {clouds.shape[1]} points a shape, {points} wanted; ask for fewer with --points")
    if labels.dtype.kind not in "iu" or (labels < 0).any() or (labels >= len(names)).any():
        raise UserError(f"{path}: has labels outside 0..{len(names) - 1}, the lines of shape_names.txt")
    categories = [names[label] for label in labels]
    files = _file_names(folder := path.parent, split, number, len(labels))
    if files is None:
        stems = [f"{path.stem}_{row:04d}" for row in range(len(labels))]
    else:
        stems = [Path(file).stem for file in files]
        wrong = [file for file, category in zip(files, categories, strict=True) if Path(file).parent.name != category]
        if wrong:
            raise UserError(f"{folder}: id2file.json and labels of {path.name} disagree ({wrong[0]})")
    ids = [f"{category}/{split}/{stem}" for category, stem in zip(categories, stems, strict=True)]
    return clouds.astype(np.float32, copy=False), categories, ids


def _shape_names(folder: Path) -> list[str]:
    path = folder / "shape_names.txt"
    names = read_bytes(path).decode("utf-8", errors="replace").split()
    if len(set(names)) != len(names):
        raise UserError(f"{path}: a category is named twice")
    return names


def _file_names(folder: Path, split: str, number: int, count: int) -> list[str] | None:
    """Return a pack file's shape names, or None where the pack has no such list."""
    path = folder / f"ply_data_{split}_{number}_id2file.json"
    if not path.exists():
        return None
    with naming(path, "JSON file", ValueError, RecursionError):
        files = json.loads(read_bytes(path))
    if not (isinstance(files, list) and len(files) == count and all(isinstance(file, str) for file in files)):
        raise UserError(f"{path}: expected a list of {count} file names")
    return files
