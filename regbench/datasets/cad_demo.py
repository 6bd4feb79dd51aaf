"""`cad_demo`: procedural CAD-like shapes that ship inside; needs no download and no disk."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import numpy as np

from regbench.datasets.cad_shapes import CATEGORIES
from regbench.datasets.dataset import Dataset, Split
from regbench.datasets.surface import sample_surface, to_unit_sphere

POINTS = 1024
SHAPES_PER_CATEGORY = {"train": 8, "test": 16}


def open_dataset(data_dir: Path) -> Dataset:
    """Make the shapes: 14 categories, 112 for "train" and 224 for "test", 1024 points each; `data_dir` is not used.

    Points are drawn uniformly by area over the parts' surfaces, centred, scaled to the unit sphere and rounded to
    1e-5 (as ModelNet40's packs are), which absorbs the last bit in which sine and cosine differ between machines.
    """
    return _make()


@cache
def _make() -> Dataset:
    splits = {name: _make_split(name, count) for name, count in SHAPES_PER_CATEGORY.items()}
    digest = hashlib.sha256()
    for split in splits.values():
        for array in (split.points, split.labels):
            digest.update(array.tobytes())
    description = "procedural CAD-like shapes of boxes, cylinders, cones, tori, spheres and extrusions"
    return Dataset("cad_demo", tuple(CATEGORIES), splits, digest.hexdigest(), description)


def _make_split(split: str, count: int) -> Split:
    # Categories take turns, so that the first few shapes (`--limit`) are of every kind.
    names = [(category, number) for number in range(count) for category in CATEGORIES]
    points = np.stack([_make_shape(split, category, number) for category, number in names])
    labels = np.tile(np.arange(len(CATEGORIES), dtype=np.int64), count)
    points.flags.writeable = labels.flags.writeable = False
    return Split(points, labels, tuple(f"{category}/{split}_{number:04d}" for category, number in names))


def _make_shape(split: str, category: str, number: int) -> np.typing.NDArray[np.float32]:
    """Return one shape, (1024, 3) float32: the same whichever others are made."""
    seed = hashlib.sha256(f"cad_demo|{split}|{category}|{number}".encode()).digest()[:8]
    rng = np.random.Generator(np.random.PCG64(int.from_bytes(seed, "little")))
    # Corners on a grid: all that follows is then arithmetic that is exact to the bit everywhere.
    corners = np.concatenate(CATEGORIES[category](rng)).round(6).reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return to_unit_sphere(sample_surface(corners, faces, POINTS, rng)).round(5).astype(np.float32)
