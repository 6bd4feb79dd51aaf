"""ModelNet40 from Princeton's tree of meshes, from an HDF5 pack, or from a tree of .npy clouds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from regbench.datasets.dataset import Split
from regbench.datasets.store_writer import write_dataset
from regbench.errors import UserError

from .modelnet40_source import Shapes, read_source
from .outcome import say_outcome

NAME = "modelnet40"
FLAT_EXTENT = 1e-3
_NAMES = """
airplane bathtub bed bench bookshelf bottle bowl car chair cone cup curtain desk door dresser flower_pot glass_box
guitar keyboard lamp laptop mantel monitor night_stand person piano plant radio range_hood sink sofa stairs stool
table tent toilet tv_stand vase wardrobe xbox
"""
CATEGORIES = _NAMES.split()


def prepare(source: Path, data_dir: Path, *, points: int = 1024, seed: int = 0, report: Callable[[str], None]) -> Path:
    """Prepare ModelNet40 from any of its three layouts.

    * A tree of .off meshes: points drawn uniformly by area, centred, scaled to the unit sphere.
    * The ply_hdf5 pack: the first `points` points of each shape, unchanged.
    * A tree of .npy clouds: centred, scaled to the unit sphere, `points` of them drawn without replacement.

    Labels index the 40 categories in alphabetical order, whichever of them are there, so that they agree between
    layouts and samples. Broken and empty shapes are left out and named, flat ones kept and named.

    Args:
        source: Folder of the raw data, or the one that holds it.
        data_dir: Folder of prepared datasets.
        points: Points a shape.
        seed: Seed of the draws (the pack needs none).
        report: Called with one line on what was done, or is odd.

    Returns:
        The prepared dataset's folder.

    Raises:
        UserError: The layout is none of these, or no shape can be used, or the dataset cannot be written.
    """
    shapes = read_source(source, points, seed)
    if not shapes.ids:
        why = next((f" ({item}: {why})" for item, why in shapes.left_out.items()), "")
        raise UserError(f"{source}: none of its shapes can be used{why}")
    remarks = _flat(shapes)
    label_names = _label_names(shapes)
    splits = {
        split: Split(
            shapes.points[split],
            np.array([label_names.index(category) for category in shapes.categories[split]], dtype=np.int64),
            shapes.ids[split],
        )
        for split in shapes.ids
    }
    if "test" not in splits:  # a sample of training meshes: there is nothing else to evaluate on
        splits = {"test": splits["train"]}
        remarks["split test"] = "the source has no test shapes: its train shapes are used as test"
    changed = write_dataset(
        data_dir,
        NAME,
        description=shapes.description,
        label_names=label_names,
        splits=splits,
        options={"points": points, "seed": seed},
        left_out=shapes.left_out,
        remarks=remarks,
    )
    counts = " and ".join(f"{len(split)} {name}" for name, split in splits.items())
    say_outcome(report, NAME, f"{counts} shapes of {points} points", shapes.left_out, remarks, changed=changed)
    return data_dir / NAME


def _label_names(shapes: Shapes) -> list[str]:
    """Return all 40 categories where the shapes are of them, else the shapes' own in alphabetical order."""
    found = set().union(*shapes.categories.values())
    return list(CATEGORIES) if found <= set(CATEGORIES) else sorted(found)


def _flat(shapes: Shapes) -> dict[str, str]:
    remarks = {}
    for split, clouds in shapes.points.items():
        extents = (clouds.max(axis=1) - clouds.min(axis=1)).min(axis=1)
        for row in np.flatnonzero(extents < FLAT_EXTENT):
            remarks[shapes.ids[split][row]] = f"flat: its least extent is {extents[row]:.1g}"
    return remarks
