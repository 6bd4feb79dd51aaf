"""What a prepared dataset is to the rest of regbench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Split:
    """Clouds of one split, all with the same number of points.

    Attributes:
        points: (S, P, 3) float32, memory-mapped or in memory, read-only. Points of a shape are in random order, so
            the first n are a fair subset.
        labels: (S,) integer category of each cloud, an index into the dataset's `label_names`.
        ids: S names, each unique within the dataset (for 7-Scenes `scene/sequence/frame-XXXXXX`).
        poses: (S, 4, 4) float64 camera-to-world motions in metres, or None.
    """

    points: NDArray[np.float32]
    labels: NDArray[np.int64]
    ids: Sequence[str]
    poses: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Dataset:
    """A named set of clouds.

    Attributes:
        name: As the registry calls it.
        label_names: Category (or scene) names.
        splits: By name, "train" and "test"; 7-Scenes has one split "scans" that its protocols divide.
        sha256: Identity of the content: equal exactly when every array is.
        description: One line on where the clouds come from.
    """

    name: str
    label_names: Sequence[str]
    splits: Mapping[str, Split]
    sha256: str
    description: str
