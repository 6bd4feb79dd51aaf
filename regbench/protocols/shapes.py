"""A protocol over the test shapes of a dataset of centred, unit-sphere CAD shapes (ModelNet40, cad_demo)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from regbench.errors import UserError
from regbench.protocols.moved_copy import Cloud, Clouds, MovedCopies, copied, cropped, resampled
from regbench.protocols.protocol import ProblemSet, Protocol
from regbench.registry import open_dataset


@dataclass(frozen=True, kw_only=True)
class ShapeProtocol(Protocol):
    """One problem for each test shape.

    Attributes:
        kind: How the two clouds come from the shape (see moved_copy.py).
        shape_points: The first so many points of a shape are used.
        first_label: Shapes with a smaller label are left out.
    """

    kind: Literal["clean", "noise", "noise-shared", "resampled", "partial"]
    shape_points: int
    first_label: int = 0

    def open(self, data_dir: Path) -> ProblemSet:
        """Open the problems; see `Protocol.open`."""
        assert self.dataset is not None
        dataset = open_dataset(self.dataset, data_dir)
        split = dataset.splits["test"]
        if split.points.shape[1] < self.shape_points:
            raise UserError(
                f"protocol {self.id} needs {self.shape_points} points a shape, dataset {dataset.name} in {data_dir} "
                f"has {split.points.shape[1]}; prepare it with --points {self.shape_points} or more"
            )
        chosen = np.flatnonzero(np.asarray(split.labels) >= self.first_label).tolist()
        return MovedCopies(
            protocol=self.id,
            clouds=lambda index: np.asarray(split.points[chosen[index], : self.shape_points], dtype=np.float64),
            labels=[dataset.label_names[split.labels[shape]] for shape in chosen],
            ids=[split.ids[shape] for shape in chosen],
            make=self._make,
            data_sha256=dataset.sha256,
        )

    def _make(self, cloud: Cloud, T: Cloud, protocol: str, index: int) -> Clouds:
        match self.kind:
            case "clean":
                return copied(cloud, T, protocol, index, noise="none")
            case "noise":
                return copied(cloud, T, protocol, index, noise="both")
            case "noise-shared":
                return copied(cloud, T, protocol, index, noise="shared")
            case "resampled":
                return resampled(cloud, T, protocol, index, points=self.shape_points // 2)
            case "partial":
                return cropped(cloud, T, protocol, index, keep=0.7)
