"""Where to start ICP: the most promising motions of a grid (a heuristic: no bound depends on it).

All lengths are in voxels of the target's grid, whose low corner is the origin.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import ceil, cos, degrees, log2, radians

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .bounds import rotate, squared_error_bound
from .rotation_cells import is_outside_ball, is_repeated, rotation_at
from .space import Space

# Edges of the first and the last grid's cells. The basin of ICP is some 30 degrees wide where a shape is distinct, and
# as narrow as its points are apart where it is nearly round.
FIRST_DEG, LAST_DEG = 25.0, 3.0
# Where translations are searched too, the last grid is coarser: ICP goes on from there.
LAST_DEG_WITH_TRANSLATIONS = 7.0
# So often is the box of translations halved, and so many of its parts are kept each time.
TRANSLATION_LEVELS, TRANSLATION_BEAM = 4, 8
# Rotations nearer to each other than this lead ICP to the same end.
APART_DEG = 2.0
# Cells between two looks at the clock: some milliseconds.
CELLS_AT_ONCE = 256


def promising_rotations(
    space: Space, translation: NDArray[np.float32], *, beam: int, starts: int, end: float
) -> NDArray[np.float32]:
    """Return rotations of small error about one translation, the best first, (S, 3, 3) with S <= starts.

    Args:
        space: What is searched, with the points that shall be looked at.
        translation: (3,) float32.
        beam: Cells that are split on every level.
        starts: Most rotations returned.
        end: Of the search, by `time.thread_time`: then the best of the cells seen so far are returned.
    """
    cells, level = _grid(space)
    while True:
        errors = np.full(len(cells), np.inf)
        for part in _parts(len(cells), end):
            errors[part] = _errors(space, cells[part], translation)
        if _edge_deg(space, level) <= LAST_DEG or time.thread_time() >= end:
            break
        level += 1
        best = cells[np.argsort(errors, kind="stable")[:beam]]
        cells = _split(best, space.rotation_half, 0.5**level, space.euler)
    best = cells[np.argsort(errors, kind="stable")[: np.isfinite(errors).sum()]]
    return _first_apart(best, space.euler, cos(radians(APART_DEG)), starts)[0]


def promising_motions(
    space: Space, *, beam: int, starts: int, end: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return motions that bring many points near the target, the best first: (S, 3, 3) and (S, 3), S <= starts.

    For clouds that overlap in part, of which the centroids do not match: each rotation of the first grid has a beam of
    ever smaller boxes of translations, and each rotation of a finer grid looks about the best of its parent's.

    Args:
        space: What is searched, with the points that shall be looked at; `half` and `centre` are those of the
            translations to look at.
        beam: Cells that are split on every level.
        starts: Most motions returned.
        end: Of the search, by `time.thread_time`: then the best of the cells seen so far are returned.
    """
    cells, level = _grid(space)
    scores, translations = np.full(len(cells), np.inf), np.empty((len(cells), 3), np.float32)
    for part in _parts(len(cells), end):
        scores[part], translations[part] = _scores_with_translations(space, cells[part], _turn(space, level))
    step = space.half * 0.5**TRANSLATION_LEVELS
    while _edge_deg(space, level) > LAST_DEG_WITH_TRANSLATIONS and time.thread_time() < end:
        best = np.argsort(scores, kind="stable")[:beam]
        level += 1
        cells, parents = _split_with_parents(cells[best], space.rotation_half, 0.5**level, space.euler)
        guesses = translations[best][parents]
        scores, translations = np.full(len(cells), np.inf), np.empty((len(cells), 3), np.float32)
        for part in _parts(len(cells), end):
            scores[part], translations[part] = _scores_near(
                space, cells[part], guesses[part], step, _turn(space, level)
            )
        step = step / 2
    order = np.argsort(scores, kind="stable")[: np.isfinite(scores).sum()]
    rotations, chosen = _first_apart(cells[order], space.euler, cos(radians(APART_DEG)), starts)
    return rotations, translations[order[chosen]]


def _grid(space: Space) -> tuple[NDArray[np.float64], int]:
    """Return the centres (C, 3) of the first grid's cells, and how often the range was halved for it."""
    cells = space.rotation_centre[None]
    level = ceil(log2(max(_edge_deg(space, 0) / FIRST_DEG, 1.0)))
    for halved in range(1, level + 1):
        cells = _split(cells, space.rotation_half, 0.5**halved, space.euler)
    return cells, level


def _parts(count: int, end: float) -> Iterator[slice]:
    """Yield slices of so many cells, one after the other, until the time is over."""
    for first in range(0, count, CELLS_AT_ONCE):
        if time.thread_time() >= end:
            return
        yield slice(first, first + CELLS_AT_ONCE)


def _edge_deg(space: Space, level: int) -> float:
    return degrees(2 * space.rotation_half.max()) * 0.5**level


def _turn(space: Space, level: int) -> float:
    """Return how far the points are moved, on average, by a turn of a quarter of a level's cell."""
    return radians(_edge_deg(space, level)) / 4 * float(space.reach.mean())


def _split(cells: NDArray[np.float64], half: NDArray[np.float64], scale: float, euler: bool) -> NDArray[np.float64]:
    """Return the centres of the cells' eighths, but of those outside the ball; `scale` is that of the eighths."""
    return _split_with_parents(cells, half, scale, euler)[0]


@njit(cache=True)
def _split_with_parents(
    cells: NDArray[np.float64], half: NDArray[np.float64], scale: float, euler: bool
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return what `_split` does, and of which cell each is an eighth."""
    children, parents = np.empty((8 * len(cells), 3)), np.empty(8 * len(cells), np.int64)
    count = 0
    for parent in range(len(cells)):
        for corner in range(8):
            if is_repeated(corner, half):
                continue
            for axis in range(3):
                side = 1.0 if corner >> axis & 1 else -1.0
                children[count, axis] = cells[parent, axis] + side * scale * half[axis]
            parents[count] = parent
            if not is_outside_ball(children[count, 0], children[count, 1], children[count, 2], half, scale, euler):
                count += 1
    return children[:count], parents[:count]


@njit(cache=True)
def _errors(space: Space, cells: NDArray[np.float64], translation: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return about the sum of squared errors of every cell's centre, (C,)."""
    count = space.points.shape[1]
    rotated, squares = np.empty((3, count), np.float32), np.empty(count, np.float32)
    rotation, still = np.empty((3, 3), np.float32), np.zeros(count, np.float32)
    errors = np.empty(len(cells))
    for index in range(len(cells)):
        rotation_at(cells[index, 0], cells[index, 1], cells[index, 2], space.euler, rotation)
        rotate(space.points, rotation, rotated)
        errors[index] = squared_error_bound(
            rotated, still, 0.0, translation, 0.0, space.distances, space.shape, space.kept, np.inf, squares
        )
    return errors


@njit(cache=True)
def _scores_with_translations(
    space: Space, cells: NDArray[np.float64], turn: float
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Return for every cell's centre the score of the best translation found, (C,), and that translation, (C, 3)."""
    rotated = np.empty((3, space.points.shape[1]), np.float32)
    rotation = np.empty((3, 3), np.float32)
    scores, translations = np.empty(len(cells)), np.empty((len(cells), 3), np.float32)
    kept, kept_scores = np.empty((TRANSLATION_BEAM, 3), np.float32), np.empty(TRANSLATION_BEAM)
    split, split_scores = np.empty((8 * TRANSLATION_BEAM, 3), np.float32), np.empty(8 * TRANSLATION_BEAM)
    for index in range(len(cells)):
        rotation_at(cells[index, 0], cells[index, 1], cells[index, 2], space.euler, rotation)
        rotate(space.points, rotation, rotated)
        kept[0], width = space.centre, 1
        for level in range(1, TRANSLATION_LEVELS + 1):
            scale = 0.5**level
            near = turn + 0.5 * scale * np.sqrt((space.half**2).sum())
            for parent in range(width):
                for corner in range(8):
                    child = 8 * parent + corner
                    for axis in range(3):
                        side = 1.0 if corner >> axis & 1 else -1.0
                        split[child, axis] = kept[parent, axis] + side * scale * space.half[axis]
                    split_scores[child] = _score(rotated, split[child], space.distances, space.shape, near)
            children = 8 * width
            width = min(children, TRANSLATION_BEAM)
            for place in range(width):
                best = int(np.argmin(split_scores[:children]))
                kept[place], kept_scores[place] = split[best], split_scores[best]
                split_scores[best] = np.inf
        scores[index] = kept_scores[0]
        translations[index] = kept[0]
    return scores, translations


@njit(cache=True)
def _scores_near(
    space: Space,
    cells: NDArray[np.float64],
    guesses: NDArray[np.float32],
    step: NDArray[np.float64],
    turn: float,
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Return what `_scores_with_translations` does, of the 27 translations that are up to a step from each guess."""
    rotated = np.empty((3, space.points.shape[1]), np.float32)
    rotation, place = np.empty((3, 3), np.float32), np.empty(3, np.float32)
    near = turn + 0.5 * np.sqrt((step**2).sum())
    scores, translations = np.full(len(cells), np.inf), np.empty((len(cells), 3), np.float32)
    for index in range(len(cells)):
        rotation_at(cells[index, 0], cells[index, 1], cells[index, 2], space.euler, rotation)
        rotate(space.points, rotation, rotated)
        for i in range(-1, 2):
            for j in range(-1, 2):
                for k in range(-1, 2):
                    place[0] = guesses[index, 0] + i * step[0]
                    place[1] = guesses[index, 1] + j * step[1]
                    place[2] = guesses[index, 2] + k * step[2]
                    score = _score(rotated, place, space.distances, space.shape, near)
                    if score < scores[index]:
                        scores[index] = score
                        translations[index] = place
    return scores, translations


@njit(cache=True, fastmath=True)
def _score(
    rotated: NDArray[np.float32],
    translation: NDArray[np.float32],
    distances: NDArray[np.float32],
    shape: NDArray[np.int64],
    near: float,
) -> float:
    """Return the sum of squared distances, none of them over `near`: points without a partner count alike."""
    zero, most = np.float32(0.0), np.float32(near * near)
    tx, ty, tz = translation[0], translation[1], translation[2]
    hx, hy, hz = np.float32(shape[0] - 1e-3), np.float32(shape[1] - 1e-3), np.float32(shape[2] - 1e-3)
    rows, columns = np.int32(shape[1]), np.int32(shape[2])
    total = zero
    for index in range(rotated.shape[1]):
        x, y, z = rotated[0, index] + tx, rotated[1, index] + ty, rotated[2, index] + tz
        u, v, w = min(max(x, zero), hx), min(max(y, zero), hy), min(max(z, zero), hz)
        inside = distances[np.uint32((np.int32(u) * rows + np.int32(v)) * columns + np.int32(w))]
        e, f, g = x - u, y - v, z - w
        total += min(inside * inside + e * e + f * f + g * g, most)
    return float(total)


@njit(cache=True)
def _first_apart(
    cells: NDArray[np.float64], euler: bool, cosine: float, most: int
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the rotations of the first cells of which none is near to one before, and the cells' indices."""
    rotations, chosen = np.empty((most, 3, 3), np.float32), np.empty(most, np.int64)
    count = 0
    for index in range(len(cells)):
        rotation_at(cells[index, 0], cells[index, 1], cells[index, 2], euler, rotations[count])
        nearest = -1.0
        for other in range(count):
            trace = 0.0
            for row in range(3):
                for column in range(3):
                    trace += rotations[count, row, column] * rotations[other, row, column]
            nearest = max(nearest, (trace - 1) / 2)
        if nearest < cosine:
            chosen[count] = index
            count += 1
            if count == most:
                break
    return rotations[:count], chosen[:count]
