"""A user's own pairs: a folder of cloud files and a table that says which belong together.

`pairs.csv` has a header and one row per pair: `source`, `target` (cloud files, relative to the folder) and, where the
truth is known, `T_target_source` (a text file with the 4x4 matrix that maps source points into the target's frame).
Clouds and truths stay in the files' unit.
"""

from __future__ import annotations

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import read_bytes
from regbench.datasets.readers.cloud import read_cloud
from regbench.datasets.readers.transform import read_transform
from regbench.errors import UserError, printable
from regbench.geometry.se3 import nearest_rigid, why_not_rigid
from regbench.protocols.protocol import Pair, ProblemSet, Protocol

TABLE = "pairs.csv"
# Matrices in the wild are printed to three or four digits.
TRUTH_TOLERANCE = 0.01
COLUMNS = ("source", "target", "T_target_source")


@dataclass(frozen=True, kw_only=True)
class PairsProtocol(Protocol):
    """A user's own pairs; version 0, frozen by nothing but its hash.

    Attributes:
        folder: Where pairs.csv is.
    """

    folder: Path

    @property
    def id(self) -> str:
        """The name as it was asked for; it carries no version."""
        return self.name

    @classmethod
    def of_folder(cls, folder: Path) -> PairsProtocol:
        """Return the protocol of a folder.

        Raises:
            UserError: The folder has no pairs.csv.
        """
        if not (folder / TABLE).is_file():
            raise UserError(f"pairs:{folder}: no {TABLE} in that folder (columns {', '.join(COLUMNS)})")
        return cls(
            name=f"pairs:{folder}",
            version=0,
            description=f"pairs of {folder}",
            dataset=None,
            headline_metrics=("rre_median_deg", "rte_median", "recall_5deg"),
            folder=folder,
        )

    def open(self, data_dir: Path) -> ProblemSet:
        """Read the table; clouds are read when a problem is asked for."""
        return _Pairs(self.folder, _read_table(self.folder / TABLE))


def _read_table(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            columns = reader.fieldnames or []
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: cannot be read as a table ({error})") from error
    if not {"source", "target"} <= set(columns):
        raise UserError(f"{path}: needs the columns source and target, has {', '.join(map(repr, columns)) or 'none'}")
    if strange := set(columns) - set(COLUMNS):
        raise UserError(f"{path}: unknown column {min(map(str, strange))!r} (there is: {', '.join(COLUMNS)})")
    for number, row in enumerate(rows, start=2):
        if None in row or not row["source"] or not row["target"]:
            raise UserError(f"{path}: line {number} must name a source and a target")
    if not rows:
        raise UserError(f"{path}: holds no pair")
    return rows


class _Pairs(ProblemSet):
    def __init__(self, folder: Path, rows: list[dict[str, str]]) -> None:
        self._folder, self._rows = folder, rows
        digest = hashlib.sha256()
        for name in [row.get(column) for row in rows for column in COLUMNS]:
            if name:
                path = folder / name
                try:
                    content = read_bytes(path)
                except UserError as error:
                    why = str(error).removeprefix(printable(f"{path}: "))
                    raise UserError(f"{folder / TABLE}: names {name!r}: {why}") from None
                digest.update(hashlib.sha256(content).digest())
        self.data_sha256 = digest.hexdigest()
        truths = [row.get("T_target_source") for row in rows]
        self._truths = [_read_truth(folder / name) if name else None for name in truths]

    def __len__(self) -> int:
        return len(self._rows)

    def pair(self, index: int) -> Pair:
        """Return problem `index`, with its answer where the table gives one."""
        row = self._rows[index]
        source, target = read_cloud(self._folder / row["source"]), read_cloud(self._folder / row["target"])
        return Pair(
            source=source,
            target=target,
            T_target_source=self._truths[index],
            label="",
            id=f"{row['source']} -> {row['target']}",
            clean_source=source,
            clean_target=target,
        )


def _read_truth(path: Path) -> NDArray[np.float64]:
    """Read a ground truth; a rotation that printing rounded is made exact.

    Raises:
        UserError: It is off by more than printing can explain.
    """
    T = read_transform(path)
    if (wrong := why_not_rigid(T, tolerance=TRUTH_TOLERANCE)) is not None:
        raise UserError(f"{path}: is not a rigid motion: {wrong}, more than {TRUTH_TOLERANCE}")
    return nearest_rigid(T)
