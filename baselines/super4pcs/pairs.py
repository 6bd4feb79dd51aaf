"""All pairs of points at a given distance: by looking at every pair, or by rasterised spheres."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

# From about so many points of a surface on, spheres are faster than all pairs (measured: 22 and 31 ms at 3,000 points,
# 0.19 and 0.34 s at 10,000).
SPHERES_FROM = 3000


def pairs_at_distance(points: NDArray[np.float32], least: float, largest: float) -> NDArray[np.int32]:
    """Return all pairs of points whose distance is in a range, by the faster of the two ways.

    Args:
        points: (N, 3) float32, finite.
        least: Least distance.
        largest: Largest distance.

    Returns:
        (K, 2) int32, indices i < j of each pair, in no particular order.
    """
    if len(points) < SPHERES_FROM:
        return pairs_of_all(points, least, largest)
    return pairs_by_spheres(points, least, largest)


@njit(cache=True)
def pairs_of_all(points: NDArray[np.float32], least: float, largest: float) -> NDArray[np.int32]:
    """Return what `pairs_at_distance` does, having looked at every pair: O(N^2)."""
    count = len(points)
    low, high = np.float32(max(least, 0.0) ** 2), np.float32(largest**2)
    xs, ys, zs = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    squares = np.empty(count, np.float32)
    pairs, found = np.empty((max(1024, 16 * count), 2), np.int32), 0
    for i in range(count):
        x, y, z = xs[i], ys[i], zs[i]
        # A loop of its own, which the compiler turns into vector instructions.
        for j in range(i + 1, count):
            squares[j] = (xs[j] - x) * (xs[j] - x) + (ys[j] - y) * (ys[j] - y) + (zs[j] - z) * (zs[j] - z)
        if found + count > len(pairs):
            pairs = _grown(pairs)
        for j in range(i + 1, count):
            # Written always, counted where it fits: no branch to mispredict.
            pairs[found, 0] = i
            pairs[found, 1] = j
            found += (squares[j] >= low) & (squares[j] <= high)
    return pairs[:found].copy()


@njit(cache=True)
def pairs_by_spheres(points: NDArray[np.float32], least: float, largest: float) -> NDArray[np.int32]:
    """Return what `pairs_at_distance` does, by spheres rasterised in a grid (Super 4PCS, section 3.1).

    All points of a voxel share one raster of the shell between the two distances: per column of voxels one run of them
    above and one below. Points are sorted by voxel, so the points of a run lie beside each other in memory.
    """
    order, starts, cell, shape = _sorted_by_voxel(points)
    columns = _shell(max(least, 0.0), largest, cell, shape)
    sorted_points = points[order]
    low, high = np.float32(max(least, 0.0) ** 2), np.float32(largest**2)
    pairs, found = np.empty((max(1024, 16 * len(points)), 2), np.int32), 0
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                here = (i * shape[1] + j) * shape[2] + k
                first, last = starts[here], starts[here + 1]
                if first == last:
                    continue
                for column in range(len(columns)):
                    di, dj, nearest, farthest = columns[column]
                    if i + di >= shape[0] or j + dj < 0 or j + dj >= shape[1]:
                        continue
                    row = ((i + di) * shape[1] + j + dj) * shape[2]
                    for side in range(2):
                        if side == 0:
                            bottom, top = k + nearest, k + farthest
                        else:
                            # Each pair is met from one of its points: in the voxel's own column, from below.
                            if di == 0 and dj == 0:
                                continue
                            bottom, top = k - farthest, k - max(nearest, 1)
                        bottom, top = max(bottom, 0), min(top, shape[2] - 1)
                        if bottom > top:
                            continue
                        begin, end = starts[row + bottom], starts[row + top + 1]
                        if begin == end:
                            continue
                        for one in range(first, last):
                            if found + (end - begin) > len(pairs):
                                pairs = _grown(pairs)
                            x, y, z = sorted_points[one]
                            for other in range(max(begin, one + 1) if row + bottom == here else begin, end):
                                dx = sorted_points[other, 0] - x
                                dy = sorted_points[other, 1] - y
                                dz = sorted_points[other, 2] - z
                                square = dx * dx + dy * dy + dz * dz
                                if low <= square <= high:
                                    pairs[found, 0] = min(order[one], order[other])
                                    pairs[found, 1] = max(order[one], order[other])
                                    found += 1
    return pairs[:found].copy()


@njit(cache=True)
def _grown(pairs: NDArray[np.int32]) -> NDArray[np.int32]:
    larger = np.empty((2 * len(pairs), 2), np.int32)
    larger[: len(pairs)] = pairs
    return larger


@njit(cache=True)
def _sorted_by_voxel(
    points: NDArray[np.float32],
) -> tuple[NDArray[np.int64], NDArray[np.int64], float, NDArray[np.int64]]:
    """Return the points' indices by voxel, where each voxel's begin, a voxel's edge, and the voxels along each axis."""
    least, sides = np.empty(3), np.empty(3)
    for axis in range(3):
        least[axis] = points[:, axis].min()
        sides[axis] = points[:, axis].max() - least[axis]
    longest = max(sides.max(), 1e-30)
    # A surface of N points then has a few points in each voxel that it meets.
    along = min(max(int(np.sqrt(len(points) / 4)), 1), 128)
    cell = longest / along * 1.000001
    shape = (sides / cell).astype(np.int64) + 1
    voxels = np.empty(len(points), np.int64)
    starts = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    for index in range(len(points)):
        i, j, k = ((points[index] - least) / cell).astype(np.int64)
        voxels[index] = (i * shape[1] + j) * shape[2] + k
        starts[voxels[index] + 1] += 1
    starts = np.cumsum(starts)
    order, filled = np.empty(len(points), np.int64), starts[:-1].copy()
    for index in range(len(points)):
        order[filled[voxels[index]]] = index
        filled[voxels[index]] += 1
    return order, starts, cell, shape


@njit(cache=True)
def _shell(least: float, largest: float, cell: float, shape: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the columns of voxels that the shell about a voxel meets, as (di, dj, nearest dk, farthest dk) from it.

    Of the columns at (di, dj) and (-di, -dj), one.
    """
    # Rounding must not lose a pair.
    inner, outer = (least / cell * 0.999999) ** 2, (largest / cell * 1.000001) ** 2
    reach = int(largest / cell) + 2
    columns = []
    for di in range(min(reach, shape[0] - 1) + 1):
        for dj in range(-min(reach, shape[1] - 1), min(reach, shape[1] - 1) + 1):
            if di == 0 and dj < 0:
                continue
            near = max(abs(di) - 1, 0) ** 2 + max(abs(dj) - 1, 0) ** 2
            far = (abs(di) + 1) ** 2 + (abs(dj) + 1) ** 2
            if near > outer:
                continue
            nearest = max(int(np.ceil(np.sqrt(max(inner - far, 0.0)))) - 1, 0)
            farthest = int(np.sqrt(outer - near)) + 1
            columns.append((di, dj, nearest, farthest))
    table = np.empty((len(columns), 4), np.int64)
    for index, column in enumerate(columns):
        table[index, 0], table[index, 1], table[index, 2], table[index, 3] = column
    return table
