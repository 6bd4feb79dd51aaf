"""The clouds that learned methods are trained on: a dataset's training split, of which some are held out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from regbench.errors import UserError
from regbench.protocols.seven_scenes import normalised, split_scans
from regbench.registry import open_dataset

DatasetName = Literal["modelnet40", "7scenes"]


@dataclass(frozen=True)
class TrainingClouds:
    """Clouds of a training split, as the protocols take them; no test cloud is among them.

    Attributes:
        dataset: "modelnet40" (its training split) or "7scenes" (the protocol's 296 training scans).
        data: Folder of the prepared datasets.
        points: Points that a cloud must have; of ModelNet40's, the first so many are taken, of a scan all.
        held_out: Clouds that training never sees: validation.
        where: Beginning of messages, e.g. "latentcem: [method]".
    """

    dataset: DatasetName
    data: Path
    points: int
    held_out: int
    where: str

    @property
    def trained(self) -> NDArray[np.int64]:
        """Indices of the clouds that are trained on."""
        return self._shuffled[self.held_out :]

    @property
    def validated(self) -> NDArray[np.int64]:
        """Indices of those held out."""
        return self._shuffled[: self.held_out]

    def cloud(self, index: int) -> NDArray[np.float64]:
        """Return a cloud, (N, 3) with N >= points."""
        if self.dataset == "modelnet40":
            return np.asarray(self._points[index, : self.points], dtype=np.float64)
        return normalised(np.asarray(self._points[index], dtype=np.float64))

    def card(self) -> dict[str, Any]:
        """Return what a model card says of the data."""
        return {
            "dataset": self.dataset,
            "sha256": self._opened.sha256,
            "clouds trained on": len(self.trained),
            "clouds held out": len(self.validated),
        }

    @cached_property
    def _opened(self) -> Any:
        return open_dataset(self.dataset, self.data)

    @cached_property
    def _points(self) -> NDArray[np.float32]:
        points = np.asarray(self._opened.splits["train" if self.dataset == "modelnet40" else "scans"].points)
        if points.shape[1] < self.points:
            raise UserError(f"{self.where} points = {self.points}: clouds of {self.dataset} have {points.shape[1]}")
        return points

    @cached_property
    def _shuffled(self) -> NDArray[np.int64]:
        """Indices of the split in a fixed random order."""
        if self.dataset == "modelnet40":
            indices = np.arange(len(self._points))
        else:
            indices, _ = split_scans(self._opened.splits["scans"].ids)
        if self.held_out >= len(indices):
            raise UserError(
                f"{self.where} held_out = {self.held_out} leaves no cloud to train on: {self.dataset} has "
                f"{len(indices)}"
            )
        return np.random.Generator(np.random.PCG64(1)).permutation(indices)
