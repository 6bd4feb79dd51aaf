"""Two files of a user's own, aligned by methods in workers, as in a run but with no truth and no table."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from regbench.datasets.readers.cloud import check_writable, read_cloud, write_cloud
from regbench.errors import UserError
from regbench.geometry.se3 import transform
from regbench.protocols.pairs import COLUMNS, TABLE
from regbench.runner.config import load_config
from regbench.runner.local import LocalExecutor
from regbench.runner.run import make_plan
from regbench.runner.status import Status


def align_files(
    source: Path,
    target: Path,
    *,
    methods: Sequence[str],
    plugins: Sequence[Path] = (),
    timeout: float = 60.0,
    memory: float = 8.0,
    threads: int = 1,
    seed: int = 0,
    save: Path | None = None,
    picture: Path | None = None,
    note: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Align one cloud file to another; return each method's row with `mean_distance` and `best`.

    `mean_distance` is the mean distance from a moved source point to its nearest target point, in the files' unit. It
    is all there is to compare by without ground truth, and it favours an answer that is right where the clouds
    overlap in full. `note` takes what the user should know meanwhile.

    Raises:
        UserError: A file cannot be read or written, a method is unknown, or an option has a value it cannot have.
    """
    for path in (save, picture):
        if path is not None and not path.parent.is_dir():
            raise UserError(f"{path}: the folder {path.parent} does not exist")
    if save is not None:
        check_writable(save)
    if picture is not None and picture.suffix.lower() != ".png":
        raise UserError(f"{picture}: pictures are written as .png")
    source_points, target_points = read_cloud(source), read_cloud(target)
    with tempfile.TemporaryDirectory(prefix="regbench-align-") as name:
        folder = Path(name)
        with (folder / TABLE).open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([COLUMNS[:2], (source.resolve(), target.resolve())])
        options = {
            "method": list(methods),
            "protocol": [f"pairs:{folder}"],
            "timeout": timeout,
            "memory": memory,
            "threads": threads,
            "seed": seed,
            "plugin": [str(path) for path in plugins],
        }
        config = load_config(None, options)
        plan, _ = make_plan(config)
        rows: list[dict[str, Any]] = []
        LocalExecutor().execute(plan, set(), folder, rows.append, note)
    order = [planned.method.asked for planned in plan.methods]
    rows.sort(key=lambda row: order.index(row["method"]))
    tree = cKDTree(target_points)
    for row in rows:
        row["mean_distance"] = None
        if row["status"] == Status.OK:
            distances, _ = tree.query(transform(row["T_target_source"], source_points))
            row["mean_distance"] = float(np.mean(distances))
    answered = [row for row in rows if row["status"] == Status.OK]
    best = min(answered, key=lambda row: row["mean_distance"], default=None)
    for row in rows:
        row["best"] = row is best
    if best is not None:
        T_target_source = np.asarray(best["T_target_source"])
        if save is not None:
            write_cloud(save, transform(T_target_source, source_points))
        if picture is not None:
            from regbench.report.picture import save_before_after

            save_before_after(picture, source_points, target_points, T_target_source)
    keys = ("method", "status", "error", "T_target_source", "mean_distance", "best", "time_ms", "cpu_ms")
    return [{key: row[key] for key in keys} for row in rows]
