"""Go-ICP from end to end: distance grid, first motions, branch and bound, ICP from every improvement."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import takewhile
from math import ceil, cos, inf, pi, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.geometry.distance_grid import DistanceGrid
from regbench.geometry.grid_icp import grid_icp
from regbench.geometry.icp import icp
from regbench.geometry.nearest_tree import build_tree, nearest_neighbours
from regbench.geometry.se3 import se3, transform
from regbench.geometry.thinning import drawn, spread

from .branch_and_bound import FINISHED, FULL, IMPROVED, search_slice
from .exploration import APART_DEG, promising_motions, promising_rotations
from .heap import push
from .space import Space, empty_heap

Motion = NDArray[np.float64]
Progress = Callable[[float, float, int], None]

# Points of the first search's errors, and of its ICP.
GLANCED_AT, FOLLOWED = 128, 256
# ICP on the grid ends after so many iterations, or where the mean square falls by less than this share.
GRID_ITERATIONS, GRID_TOLERANCE = 30, 1e-3
# Exact ICP of a finalist ends where the residual falls by less than this share; the best of them goes on to the end.
FINALIST_TOLERANCE = 1e-2
# Mean squared error, in voxels, at which two clouds are the same.
SAME = 1e-12
# Points of the target that are searched with, for one of the source.
TARGET_POINTS = 5
# Where clouds were thinned: points of the source of the last ICP, for one searched with, and its most iterations.
LAST_POINTS, LAST_ITERATIONS = 5, 20
# Edge of the voxels that the bounds are read from, in roots of the threshold; and most of them along a side.
VOXEL_OF_BOUNDS, MOST_CELLS_OF_BOUNDS = 0.6, 160
# Between two looks at the clock branch and bound takes about so long, in seconds.
SLICE_S = 0.01
# Cells that wait at most: of rotations, and of translations in the inner search.
OUTER_CELLS, INNER_CELLS = 1_000_000, 20_000


@dataclass(frozen=True, kw_only=True)
class Box:
    """A range of parameters: `middle` and `half` edges, (3,) float64 each."""

    middle: NDArray[np.float64]
    half: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How to search. Lengths are in the clouds' unit, errors in its square.

    Attributes:
        threshold: Stop when no motion can have a mean squared error smaller than the answer's by more than this.
        overlap: Share of the source's points, those with the least errors, that count.
        euler_rad: Range of Euler angles (R = Rx Ry Rz), or None for all rotations.
        translation: Range, or None for all translations that can be best.
        cells: Voxels of the distance grid along its longest side.
        beam: Cells of rotations that are split on every level of the first search; 0: no first search.
        starts: ICP starts of the first search.
        finalists: Ends of those that go on to exact ICP.
        max_points: Points of the source that are searched with, at most; of the target, five times as many.
        max_nodes: Most cells of rotations that branch and bound looks at, or None.
        budget_s: The search ends after so many seconds of this thread's CPU time, or None.
    """

    threshold: float
    overlap: float
    euler_rad: Box | None
    translation: Box | None
    cells: int
    beam: int
    starts: int
    finalists: int
    max_points: int
    max_nodes: int | None
    budget_s: float | None


@dataclass(frozen=True, eq=False)
class Found:
    """What the search answers.

    Attributes:
        T_target_source: (4, 4) float64.
        error: Mean squared error of the answer over the points that count, by exact nearest neighbours, of the whole
            clouds.
        gap: No motion in range has an error smaller than the answer's by more than this. Where the clouds were thinned
            the bounds of branch and bound hold for what was left of them, and this is the error: none is under zero.
        nodes: Cells of rotations that branch and bound looked at.
        points: Points of the source searched with.
    """

    T_target_source: Motion
    error: float
    gap: float
    nodes: int
    points: int


def search(
    source: NDArray[np.float64],
    target: NDArray[np.float64],
    starts: Sequence[Motion],
    settings: Settings,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> Found:
    """Search the motion of least mean squared error.

    Args:
        source: (N, 3), N >= 1, about the origin.
        target: (M, 3), M >= 1.
        starts: (4, 4) motions that ICP starts from before anything else, at least one.
        settings: How.
        seed: Of the draw of points from clouds that are much larger than what is searched with.
        progress: Called about a hundred times a second of branch and bound, with the answer's error, the bound under
            every error, and the cells of rotations looked at.
    """
    end = inf if settings.budget_s is None else time.thread_time() + settings.budget_s
    rng = np.random.default_rng(seed)
    few = spread(source, settings.max_points, rng)
    most = TARGET_POINTS * settings.max_points
    scene = _Scene(few, spread(target, most, rng) if len(target) > most else target, settings)
    for start in starts:
        scene.refine(scene.followed(start, len(few))[1])
    if settings.beam and not scene.is_same():
        scene.explore(end)
    nodes, bound = 0, 0.0
    if scene.least > settings.threshold:
        nodes, bound = scene.branch_and_bound(end, progress)
    if len(few) == len(source) and len(scene.target) == len(target):
        return Found(scene.best, scene.least, scene.least - bound, nodes, len(few))
    more = drawn(source, LAST_POINTS * settings.max_points, rng)
    last = icp(more, target, scene.best, overlap=settings.overlap, max_iterations=LAST_ITERATIONS).T_target_source
    best = min(last, scene.best, key=lambda motion: mean_squared_error(more, target, motion, settings.overlap))
    error = mean_squared_error(source, target, best, settings.overlap)
    return Found(best, error, error, nodes, len(few))


@cache
def load_kernels(*, trimmed: bool) -> None:
    """Run every kernel once in this process, on two small clouds that do not match: no budget is to pay for that."""
    rng = np.random.default_rng(0)
    source, target = rng.normal(size=(2, 60, 3)) / 3
    settings = Settings(
        threshold=1e-3,
        overlap=0.5 if trimmed else 1.0,
        euler_rad=None,
        translation=None,
        cells=16,
        beam=10,
        starts=2,
        finalists=1,
        max_points=60,
        max_nodes=20,
        budget_s=None,
    )
    search(source, target, [np.eye(4)], settings)


def mean_squared_error(
    source: NDArray[np.float64], target: NDArray[np.float64], T_target_source: Motion, overlap: float
) -> float:
    """Return the mean squared distance of the moved source's points to their nearest ones, of those that count.

    Args:
        source: (N, 3).
        target: (M, 3).
        T_target_source: (4, 4).
        overlap: Share of the points, those with the least distances, that count.
    """
    squares = nearest_neighbours(*build_tree(target), transform(T_target_source, source))[1]
    return _mean_of_least(squares, overlap)


def _mean_of_least(squares: NDArray[np.float64], overlap: float) -> float:
    kept = ceil(overlap * len(squares))
    return float(np.partition(squares, kept - 1)[:kept].mean())


class _Scene:
    """Two clouds in search, and the best motion so far."""

    def __init__(self, source: NDArray[np.float64], target: NDArray[np.float64], settings: Settings) -> None:
        self._source, self.target, self._settings = source, np.ascontiguousarray(target), settings
        self._use(DistanceGrid.of(target, cells=settings.cells))
        self._tree = build_tree(self.target)
        self.best: Motion = np.eye(4)
        self.least = inf

    def _use(self, grid: DistanceGrid) -> None:
        self._grid = grid
        self._voxel_target = ((self.target - grid.low) / grid.cell).astype(np.float32)

    def _cells_of_bounds(self) -> int:
        """Return the voxels along the longest side with which the bounds can reach the threshold.

        A bound falls short by about half a voxel's edge a point: more than the root of the threshold, and no error
        near it could be told from zero.
        """
        finest = VOXEL_OF_BOUNDS * self._settings.threshold**0.5
        cells: int = ceil(float(self._grid.shape.max()) * self._grid.cell / finest)
        return max(self._settings.cells, min(cells, MOST_CELLS_OF_BOUNDS))

    def is_same(self) -> bool:
        return self.least <= SAME * self._grid.cell**2

    def refine(self, start: Motion, tolerance: float = 0.0) -> None:
        """Follow exact ICP from a motion, and keep the end if it is the best so far."""
        overlap = self._settings.overlap
        moved = icp(self._source, self.target, start, overlap=overlap, tolerance=tolerance).T_target_source
        squares = nearest_neighbours(*self._tree, transform(moved, self._source))[1]
        error = _mean_of_least(squares, overlap)
        if error < self.least:
            self.best, self.least = moved, error

    def followed(self, start: Motion, points: int) -> tuple[float, Motion]:
        """Return where ICP on the grid ends with the first points: the mean squared error, and the motion."""
        grid, rotation, translation = self._grid, start[:3, :3].copy(), start[:3, 3].copy()
        source = self._source[:points].astype(np.float32)
        error = grid_icp(
            source,
            grid.points,
            grid.labels,
            grid.low,
            grid.cell,
            grid.shape,
            rotation,
            translation,
            ceil(self._settings.overlap * len(source)),
            GRID_ITERATIONS,
            GRID_TOLERANCE,
        )
        return error, se3(rotation, translation)

    def explore(self, end: float) -> None:
        """Refine the best motions of a grid, until the time is over: cheaply, then the best of those exactly."""
        settings = self._settings
        if settings.overlap == 1:
            space = self._space(GLANCED_AT, self._grid)
            place = -self._grid.low / np.float32(self._grid.cell)
            rotations = promising_rotations(space, place, beam=settings.beam, starts=settings.starts, end=end)
            translations = np.tile(place, (len(rotations), 1))
        else:
            # The source's centroid is likely somewhere in the target's bounding box.
            half = (self.target.max(axis=0) - self.target.min(axis=0)) / 2
            middle = self.target.min(axis=0) + half
            space = self._space(GLANCED_AT, self._grid, Box(middle=middle, half=half))
            rotations, translations = promising_motions(space, beam=settings.beam, starts=settings.starts, end=end)
        motions = [self._motion(turn, place) for turn, place in zip(rotations, translations, strict=True)]
        in_time = takewhile(lambda _: time.thread_time() < end, motions)
        followed = sorted((self.followed(motion, FOLLOWED) for motion in in_time), key=lambda found: found[0])
        taken: list[Motion] = []
        for _, motion in followed:
            if len(taken) == settings.finalists or self.is_same() or time.thread_time() >= end:
                break
            if not any(_is_near(motion, other) for other in taken):
                taken.append(motion)
                self.refine(self.followed(motion, len(self._source))[1], FINALIST_TOLERANCE)
        if taken:
            self.refine(self.best)

    def branch_and_bound(self, end: float, progress: Progress | None) -> tuple[int, float]:
        """Search until the bound is near enough or the time is over; return nodes and the bound under every error."""
        settings = self._settings
        if time.thread_time() >= end:
            return 0, 0.0
        self._use(DistanceGrid.of(self.target, cells=self._cells_of_bounds()).exact())
        space = self._space(len(self._source), self._grid)
        outer, inner = empty_heap(OUTER_CELLS), empty_heap(INNER_CELLS)
        size = push(outer.bounds, outer.cells, 0, 0.0, np.append(space.rotation_centre, 1.0))
        rotation, translation = np.empty((3, 3), np.float32), np.empty(3, np.float32)
        # The kernels' errors are sums in voxels.
        sums = space.kept / self._grid.cell**2
        most_nodes = inf if settings.max_nodes is None else settings.max_nodes
        nodes, bound, nodes_per_slice = 0, 0.0, 1
        while nodes < most_nodes and time.thread_time() < end:
            most = int(min(nodes_per_slice, most_nodes - nodes))
            began = time.thread_time()
            how, size, done, bound = search_slice(
                space,
                outer,
                inner,
                size,
                self.least * sums,
                settings.threshold * sums,
                settings.beam == 0,
                most,
                rotation,
                translation,
            )
            nodes += done
            # Cells differ in cost by orders of magnitude: the next slice is as large as this one's pace allows.
            pace_s = (time.thread_time() - began) / max(done, 1)
            nodes_per_slice = max(1, min(2 * nodes_per_slice, int(SLICE_S / max(pace_s, 1e-9))))
            if how == IMPROVED:
                self.refine(self._motion(rotation, translation))
            if progress is not None:
                progress(self.least, min(bound / sums, self.least), nodes)
            if how in (FINISHED, FULL) or self.least <= settings.threshold:
                break
        return nodes, max(0.0, min(bound / sums, self.least))

    def _motion(self, rotation: NDArray[Any], translation: NDArray[Any]) -> Motion:
        """Return the motion of a rotation and of a translation in voxels."""
        return se3(rotation.astype(np.float64), translation * self._grid.cell + self._grid.low)

    def _space(self, points: int, grid: DistanceGrid, translations: Box | None = None) -> Space:
        """Return the search's numbers in voxels, with the first points of the source."""
        settings, source = self._settings, self._source[:points] / grid.cell
        rotations = settings.euler_rad or Box(middle=np.zeros(3), half=np.full(3, pi))
        translations = translations or self._translations(settings.translation)
        return Space(
            points=np.ascontiguousarray(source.T, dtype=np.float32),
            reach=np.linalg.norm(source, axis=1).astype(np.float32),
            target=self._voxel_target,
            labels=grid.labels,
            distances=grid.distances / np.float32(grid.cell),
            shape=grid.shape,
            tree=(self._tree[0] - grid.low) / grid.cell,
            axes=self._tree[2],
            places=np.argsort(self._tree[1]),
            kept=ceil(settings.overlap * len(source)),
            euler=settings.euler_rad is not None,
            rotation_centre=rotations.middle,
            rotation_half=rotations.half,
            centre=((translations.middle - grid.low) / grid.cell).astype(np.float32),
            half=translations.half / grid.cell,
        )

    def _translations(self, stated: Box | None) -> Box:
        """Return the translations with which an error under the least one is possible, within those stated.

        The points that count are on average no farther from their matches than the root of the error, and the mean of
        the matches lies in the target's bounding box. So the mean of those points, moved, lies in that box, widened by
        the root; and it is a turned mean of some of the source's points, which is nearer to the origin than the mean
        distance of the farthest ones.
        """
        if self._settings.overlap == 1:
            reach = float(np.linalg.norm(self._source.mean(axis=0)))
        else:
            kept = ceil(self._settings.overlap * len(self._source))
            reach = float(np.sort(np.linalg.norm(self._source, axis=1))[-kept:].mean())
        wider = reach + self.least**0.5
        low, high = self.target.min(axis=0) - wider, self.target.max(axis=0) + wider
        if stated is not None:
            low, high = np.maximum(low, stated.middle - stated.half), np.minimum(high, stated.middle + stated.half)
            # A range that no good motion lies in is searched at its border.
            high = np.maximum(low, high)
        return Box(middle=(low + high) / 2, half=(high - low) / 2)


def _is_near(motion: Motion, other: Motion) -> bool:
    """Return whether ICP would end at the same motion from both, as far as one can tell: the angle is small."""
    cosine = float(np.trace(motion[:3, :3].T @ other[:3, :3]) - 1) / 2
    return cosine > cos(radians(APART_DEG))
