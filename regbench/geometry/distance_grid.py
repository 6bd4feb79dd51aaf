"""A voxel grid that knows the nearest point of a cloud everywhere: for searches that ask millions of times."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from regbench.geometry.exact_distances import exact_distances

# Squared distance, in voxels, where no point has been seen yet.
UNSEEN = np.float32(1e9)


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Voxels about a cloud, each with a nearest point and the distance to it.

    A voxel's nearest point is that of the voxel among those that hold points, so it is a near one rather than always
    the nearest; `exact` makes it the nearest.

    Attributes:
        points: (N, 3) float32, the cloud.
        low: (3,) float32, the corner of the first voxel.
        cell: Edge of a voxel.
        shape: (3,) int64, voxels along x, y, z.
        labels: (V,) int32, index of the voxel's nearest point; voxel (i, j, k) is at (i * shape[1] + j) * shape[2] + k.
        distances: (V,) float32, distance from the voxel's centre to that point.
    """

    points: NDArray[np.float32]
    low: NDArray[np.float32]
    cell: float
    shape: NDArray[np.int64]
    labels: NDArray[np.int32]
    distances: NDArray[np.float32]

    @classmethod
    def of(cls, points: NDArray[np.float64], *, cells: int = 64, margin: float = 0.1) -> DistanceGrid:
        """Make the grid of a cloud by a separable distance transform (Felzenszwalb and Huttenlocher 2012).

        Args:
            points: (N, 3), N >= 1, finite.
            cells: Voxels along the longest side.
            margin: Empty space on every side of the cloud, as a share of the longest side.

        Raises:
            ValueError: There is no point, a coordinate is not finite, or there are fewer than 2 cells.
        """
        if len(points) == 0 or not np.isfinite(points).all():
            raise ValueError("a distance grid needs points, all of them finite")
        if cells < 2:
            raise ValueError(f"a distance grid needs at least 2 cells, got {cells}")
        least, largest = points.min(axis=0), points.max(axis=0)
        longest = float((largest - least).max()) or 1.0
        cell = longest * (1 + 2 * margin) / cells
        shape = np.maximum(np.ceil((largest - least + 2 * margin * longest) / cell - 1e-9), 1).astype(np.int64)
        low = ((least + largest) / 2 - shape * cell / 2).astype(np.float32)
        cloud = np.ascontiguousarray(points, dtype=np.float32)
        labels, distances = _transform(cloud, low, np.float32(cell), shape)
        return cls(cloud, low, cell, shape, labels, distances)

    def exact(self) -> DistanceGrid:
        """Return this grid with the nearest point of every voxel's centre (to single precision): twice the work."""
        points = np.ascontiguousarray(((self.points - self.low) / np.float32(self.cell)).T, dtype=np.float32)
        labels, distances = exact_distances(points, self.shape)
        return replace(self, labels=labels, distances=distances * np.float32(self.cell))


@njit(cache=True, inline="always")
def voxel_of(
    x: float, y: float, z: float, low: NDArray[np.float32], per_cell: float, shape: NDArray[np.int64]
) -> np.int64:
    """Return the index of the voxel that holds a place, or of the nearest voxel to it.

    Args:
        x: Of the place.
        y: Of the place.
        z: Of the place.
        low: Of the grid.
        per_cell: 1 / cell.
        shape: Of the grid.
    """
    i = min(max(int((x - low[0]) * per_cell), 0), shape[0] - 1)
    j = min(max(int((y - low[1]) * per_cell), 0), shape[1] - 1)
    k = min(max(int((z - low[2]) * per_cell), 0), shape[2] - 1)
    return np.int64((i * shape[1] + j) * shape[2] + k)


@njit(cache=True)
def _transform(
    points: NDArray[np.float32], low: NDArray[np.float32], cell: np.float32, shape: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return labels and the distances from the voxels' centres to the labelled points, each (V,)."""
    width, height, depth = shape
    squares = np.full((width, height, depth), UNSEEN, np.float32)
    labels = np.full((width, height, depth), -1, np.int32)
    has_points = np.zeros((width, height), np.bool_)
    for index in range(len(points)):
        i = min(max(int((points[index, 0] - low[0]) / cell), 0), width - 1)
        j = min(max(int((points[index, 1] - low[1]) / cell), 0), height - 1)
        k = min(max(int((points[index, 2] - low[2]) / cell), 0), depth - 1)
        has_points[i, j] = True
        # Of several points in a voxel, the one nearest to its centre.
        if labels[i, j, k] < 0 or _to_centre(points, index, low, cell, i, j, k) < _to_centre(
            points, labels[i, j, k], low, cell, i, j, k
        ):
            squares[i, j, k] = 0
            labels[i, j, k] = index

    longest = max(width, height, depth)
    line, line_labels = np.empty(longest, np.float32), np.empty(longest, np.int32)
    sites, starts = np.empty(longest, np.int64), np.empty(longest + 1, np.float32)
    for i in range(width):
        any_row = False
        for j in range(height):
            if has_points[i, j]:
                _sweep(squares[i, j], labels[i, j], line, line_labels, sites, starts)
                any_row = True
        if any_row:
            for k in range(depth):
                _sweep(squares[i, :, k], labels[i, :, k], line, line_labels, sites, starts)
    distances = np.empty((width, height, depth), np.float32)
    # A line along x jumps through memory: a slab is turned first, so that it stays in the fastest cache.
    slab, slab_labels = np.empty((depth, width), np.float32), np.empty((depth, width), np.int32)
    for j in range(height):
        for i in range(width):
            for k in range(depth):
                slab[k, i] = squares[i, j, k]
                slab_labels[k, i] = labels[i, j, k]
        for k in range(depth):
            _sweep(slab[k], slab_labels[k], line, line_labels, sites, starts)
        for i in range(width):
            for k in range(depth):
                label = slab_labels[k, i]
                labels[i, j, k] = label
                distances[i, j, k] = np.sqrt(_to_centre(points, label, low, cell, i, j, k))
    return labels.reshape(-1), distances.reshape(-1)


@njit(cache=True, inline="always")
def _to_centre(
    points: NDArray[np.float32], index: int, low: NDArray[np.float32], cell: np.float32, i: int, j: int, k: int
) -> np.float32:
    """Return the squared distance of a point to a voxel's centre."""
    half = np.float32(0.5)
    x = points[index, 0] - (low[0] + (np.float32(i) + half) * cell)
    y = points[index, 1] - (low[1] + (np.float32(j) + half) * cell)
    z = points[index, 2] - (low[2] + (np.float32(k) + half) * cell)
    return np.float32(x * x + y * y + z * z)


@njit(cache=True)
def _sweep(
    squares: NDArray[np.float32],
    labels: NDArray[np.int32],
    line: NDArray[np.float32],
    line_labels: NDArray[np.int32],
    sites: NDArray[np.int64],
    starts: NDArray[np.float32],
) -> None:
    """Replace a line of squared distances by their lower envelope of parabolas, labels with them."""
    count = len(squares)
    last = -1
    for place in range(count):
        value = squares[place]
        line[place] = value
        line_labels[place] = labels[place]
        if value >= UNSEEN:
            continue
        start = np.float32(-1.0)
        while last >= 0:
            before = sites[last]
            start = ((value + np.float32(place * place)) - (line[before] + np.float32(before * before))) / np.float32(
                2 * (place - before)
            )
            if start > starts[last]:
                break
            last -= 1
        last += 1
        sites[last] = place
        starts[last] = start if last > 0 else np.float32(-1e9)
    if last < 0:
        return
    starts[last + 1] = np.float32(1e9)
    current = 0
    for place in range(count):
        while starts[current + 1] < place:
            current += 1
        site = sites[current]
        offset = np.float32(place - site)
        squares[place] = offset * offset + line[site]
        labels[place] = line_labels[site]
