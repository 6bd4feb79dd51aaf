"""Super 4PCS as a method."""

from __future__ import annotations

import time
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.distance_grid import DistanceGrid
from regbench.geometry.icp import icp
from regbench.geometry.se3 import se3, transform
from regbench.geometry.size import extent, spacing
from regbench.geometry.thinning import distinct_points, drawn, thinned

from ..flat import principal_starts
from ..local_frame import LocalFrame, require_like_sizes, require_surface
from ..small_problem import POINTS, small_problem
from .judgement import Judgement
from .search import Found, Settings, search
from .verification import least_distances

Cloud = NDArray[np.float64]
Motion = NDArray[np.float64]

# Finalists are refined whose residual is at most so many times the least.
IN_THE_RUNNING = 1.5
# Where the search has seen thinned clouds, the answer is refined by denser ones, with ever nearer matches, in spacings
# of the thinned target. Source points with none within so many times that are left out: looking for it is slow.
DENSE_REACHES = (1.0, 0.5, 0.25)
LEFT_OUT_BEYOND = 2.0
DENSE_TOLERANCE = 1e-4
# Of the counts among the parameters.
LEAST = {
    "max_points": 4,
    "max_bases": 1,
    "max_sets": 1,
    "max_tests": 1,
    "kept": 1,
    "repeats": 0,
    "cells": 2,
    "finalists": 1,
    "refine_iterations": 1,
    "refine_points": 3,
}


class Super4Pcs(Registrar):
    """Super 4PCS: congruent sets of four points (Mellado, Aiger and Mitra 2014; Aiger et al. 2008), compiled.

    Bases of four points of the source, nearly in one plane and wide, are drawn; the sets of four points of the target
    that are congruent to one each give a motion; the motions that lay the source best on the target are polished, and
    the best of all, by the exact residual, is the answer.

    Ours, beyond the paper: bases are chosen whose lengths are rare in the target; a first base looks for an exact copy;
    each base hands on several motions, which a few steps of ICP improve before they are compared; the search ends when
    several bases have found the same best motion; and the last word has the exact residual both ways, which tells a
    shape from its half-turned self.

    Clouds of fewer than four points, or all on a line, have no base, and clouds that have nothing in common no
    congruent sets: the best of the four motions that match principal axes is answered then, `converged` False.

    Lengths are in spacings of the target (of what is searched of it) but where it says otherwise. The answer's `facts`:
    `bases` drawn, congruent `sets` found, `repeated`, the bases that found the first candidate, and whether that was
    `exact`.

    Args:
        delta: Largest difference of a congruent set from its base; the paper's delta.
        overlap: Share of the smaller cloud's points that the other cloud has.
        width: Largest distance within a base, in diameters of the source times overlap.
        copy_delta: delta of the first base, which looks for an exact copy; 0: no such base.
        reach: Farthest match that counts when motions are verified.
        max_points: Points of each cloud in the search, at most; larger clouds are thinned.
        max_bases: Most bases.
        max_sets: Most congruent sets of a base.
        max_tests: Most comparisons in the search for congruent sets, of all bases: a bound on the time that does not
            depend on the machine, so that answers repeat.
        kept: Candidates that each base hands on.
        polish: Whether they are improved by a few steps of ICP on the distance grid.
        repeats: End the search when so many bases have found the best motion; 0: do not.
        confidence: End the search when a base within the common points was drawn with this probability.
        cells: Voxels of the distance grid along its longest side.
        finalists: Candidates that the exact residual decides between.
        refine: "icp": finalists are refined by exact point-to-point ICP, and the winner by the clouds as they
            were before they were thinned; or "none".
        refine_distance: Farthest match of that ICP.
        refine_iterations: Most iterations of it.
        refine_points: Points of the source that it uses, at most; of the target it uses all.
    """

    name = "super4pcs"
    presets: ClassVar = {
        "partial": {"overlap": 0.5},
        # The original program's example (Super4PCS 1.1, run-example.sh: -o 0.7 -n 200) and its rules: bases as wide as
        # the overlap times the diameter, one best motion, an end by the number of trials alone, no ICP. Its -d is
        # in scene units, 0.01 there and 5 by default, which says nothing on another scene: ours, in spacings. The
        # probability of failure, 1e-5, is that of PCL's port.
        "paper": {
            "overlap": 0.7,
            "width": 1.0,
            "copy_delta": 0.0,
            "max_points": 200,
            "kept": 1,
            "polish": False,
            "repeats": 0,
            "confidence": 0.99999,
            "finalists": 1,
            "refine": "none",
        },
    }

    def __init__(
        self,
        *,
        delta: float = 0.6,
        overlap: float = 1.0,
        width: float = 0.8,
        copy_delta: float = 0.05,
        reach: float = 1.0,
        max_points: int = 1000,
        max_bases: int = 64,
        max_sets: int = 20_000,
        max_tests: int = 200_000_000,
        kept: int = 8,
        polish: bool = True,
        repeats: int = 3,
        confidence: float = 0.9999,
        cells: int = 48,
        finalists: int = 16,
        refine: Literal["icp", "none"] = "icp",
        refine_distance: float = 2.0,
        refine_iterations: int = 50,
        refine_points: int = 20_000,
    ) -> None:
        self.delta = delta
        self.overlap = overlap
        self.width = width
        self.copy_delta = copy_delta
        self.reach = reach
        self.max_points = max_points
        self.max_bases = max_bases
        self.max_sets = max_sets
        self.max_tests = max_tests
        self.kept = kept
        self.polish = polish
        self.repeats = repeats
        self.confidence = confidence
        self.cells = cells
        self.finalists = finalists
        self.refine = refine
        self.refine_distance = refine_distance
        self.refine_iterations = refine_iterations
        self.refine_points = refine_points

    def prepare(self) -> None:
        """Compile: the first time on a machine that takes a minute or two."""
        problem = small_problem()
        for max_points in (POINTS, POINTS // 2):  # with the end of a search on thinned clouds, and without
            Super4Pcs(max_points=max_points, delta=self.delta).register(problem)

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Returns:
            The `confidence` is the share of the source's points, of those searched with, within `reach` of the target.

        Raises:
            ValueError: A cloud has fewer than three distinct points, the source is very much larger than the target,
                or a parameter is out of range.
        """
        self._require_sense()
        require_surface(problem)
        began = time.perf_counter()
        frame = LocalFrame.of(problem)
        require_like_sizes(frame)
        rng = np.random.default_rng(problem.seed)
        source, target = (self._sample(cloud, rng) for cloud in (frame.source, frame.target))
        unit = spacing(target)
        judge = Judgement(source, target, self.overlap)
        grid = DistanceGrid.of(frame.target, cells=self.cells)
        ready = time.perf_counter()
        found = search(source, target, grid, judge, self._settings(source, unit, problem.seed))
        searched = time.perf_counter()
        T_local = self._best(found, source, target, judge, unit)
        if self.refine == "icp" and (len(source) < len(frame.source) or len(target) < len(frame.target)):
            T_local = self._refined_by_dense(frame, grid, T_local, unit, rng)
        ended = time.perf_counter()
        return Registration(
            T_target_source=frame.from_local(T_local),
            converged=found.exact or found.repeated >= self.repeats if self.repeats > 0 else None,
            iterations=found.bases,
            confidence=judge.inliers(T_local, self.reach * unit),
            stages_s={"prepare": ready - began, "search": searched - ready, "refine": ended - searched},
            facts={"bases": found.bases, "sets": found.sets, "repeated": found.repeated, "exact": found.exact},
        )

    def _require_sense(self) -> None:
        if not 0 < self.overlap <= 1:
            raise ValueError(f"overlap is a share in (0, 1], got {self.overlap}")
        if not (self.delta > 0 and self.reach > 0 and self.copy_delta >= 0):
            raise ValueError("delta and reach must be above 0, copy_delta not below")
        if not 0 <= self.confidence < 1:
            raise ValueError(f"confidence is a probability below 1, got {self.confidence}")
        for name, least in LEAST.items():
            if not getattr(self, name) >= least:
                raise ValueError(f"{name} must be at least {least}, got {getattr(self, name)}")
        if not (self.width > 0 and self.refine_distance > 0):
            raise ValueError("width and refine_distance must be above 0")

    def _sample(self, cloud: Cloud, rng: np.random.Generator) -> Cloud:
        """Return what the search sees of a cloud: distinct points in random order, thinned."""
        return rng.permutation(thinned(distinct_points(cloud), self.max_points, rng))

    def _settings(self, source: Cloud, unit: float, seed: int) -> Settings:
        return Settings(
            delta=self.delta * unit,
            copy_delta=self.copy_delta * unit,
            reach=self.reach * unit,
            widest=self.width * self.overlap * 2 * extent(source),
            max_bases=self.max_bases,
            max_sets=self.max_sets,
            max_tests=self.max_tests,
            kept=self.kept,
            polish=self.polish,
            repeats=self.repeats,
            confidence=self.confidence,
            seed=seed,
        )

    def _best(self, found: Found, source: Cloud, target: Cloud, judge: Judgement, unit: float) -> Motion:
        """Return the motion, (4, 4), that leaves the least residual of the finalists, those in the running refined."""
        finalists = [se3(motion[:, :3], motion[:, 3]) for motion in found.motions[: self.finalists]]
        if not finalists:
            finalists = principal_starts(source, target)
        residuals = [judge.residual(finalist) for finalist in finalists]
        if self.refine == "icp":
            close = IN_THE_RUNNING * min(residuals)
            finalists = [
                self._refined(source, target, finalist, self.refine_distance * unit)
                for finalist, residual in zip(finalists, residuals, strict=True)
                if residual <= close
            ]
            residuals = [judge.residual(finalist) for finalist in finalists]
        return finalists[int(np.argmin(residuals))]

    def _refined(self, source: Cloud, target: Cloud, start: Motion, reach: float, tolerance: float = 0.0) -> Motion:
        return icp(
            source,
            target,
            start,
            max_iterations=self.refine_iterations,
            max_distance=reach,
            tolerance=tolerance,
        ).T_target_source

    def _refined_by_dense(
        self, frame: LocalFrame, grid: DistanceGrid, T_local: Motion, unit: float, rng: np.random.Generator
    ) -> Motion:
        source = drawn(frame.source, self.refine_points, rng)
        for reach in DENSE_REACHES:
            near = least_distances(grid, transform(T_local, source)) <= LEFT_OUT_BEYOND * reach * unit
            if near.any():
                T_local = self._refined(source[near], frame.target, T_local, reach * unit, DENSE_TOLERANCE)
        return T_local
