"""Go-ICP as a method."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from regbench.contract import MotionPrior, Problem, Registrar, Registration
from regbench.geometry.se3 import se3
from regbench.geometry.starts import start_of

from ..local_frame import LocalFrame, require_like_sizes
from .search import Box, Found, Progress, Settings, load_kernels, search


class GoIcp(Registrar):
    """Globally optimal ICP: nested branch and bound over rotations and translations (Yang et al. 2016).

    Lengths are in extents of the target, and errors in their squares. The answer's `facts` are `certified`, whether no
    motion in range has a mean squared error smaller than the answer's by more than `threshold`; `gap`, by how much one
    could be smaller at most; `error`; `nodes`, the cells of rotations that branch and bound looked at; `points`, the
    points of the source that all of this is about.

    Before branch and bound, ours looks at a grid of rotations and starts ICP at the most promising ones: a mean squared
    error under the threshold is certified without any branching, but a second minimum may be under it too.

    The CPU time of a call is at most `budget_ms` and what thinning, the first ICP, the last ICP and the error of the
    whole clouds take, which grows with the number of points. The first call of a process loads the compiled kernels.

    Args:
        threshold: Certify that no motion has a mean squared error smaller by more than this.
        motion: The range that is searched: "full", all of SE(3); "prior", what the protocol discloses of it, where it
            does, else all; "centred", rotations about matched centroids alone, which is right where clouds overlap
            fully.
        max_translation: Search translations of at most this along each axis, instead of all that can be best; of
            motion="full", and of "prior" where there is none.
        overlap: Share of the source's points, those with the least errors, that count.
        init: Where the first ICP starts: "centroid" or "identity". A start given by the problem replaces both.
        cells: Voxels of the distance grid along its longest side.
        beam: Cells of rotations that are split on every level of the first search; 0: no first search.
        starts: ICP starts of the first search, on the distance grid.
        finalists: Ends of those that go on to exact ICP.
        max_points: Points of the source that are searched with, at most, and five times as many of the target. Larger
            clouds are thinned for the search; ICP on the whole target goes on from there, and the better of the two
            motions is the answer. It is certified where its error over the whole clouds is under the threshold.
        max_nodes: Most cells of rotations that branch and bound looks at. None: no such limit.
        budget_ms: The search, the first one too, ends after so much CPU time (that of the calling thread, so that
            other work on the machine does not cut it short), and the best motion so far is answered, uncertified.
            None: no such limit. Where it ends the search, the answer depends on the machine; with `max_nodes` instead
            it repeats.
    """

    name = "goicp"
    deterministic = False
    presets: ClassVar = {
        # The original's published settings: no first search but ICP from the identity, and no limit of time.
        "paper": {
            "threshold": 1e-3,
            "max_translation": 0.5,
            "init": "identity",
            "cells": 300,
            "beam": 0,
            "budget_ms": None,
        },
        # Rotations alone, about matched centroids: for clouds that overlap fully. Half the first search.
        "fast": {"motion": "centred", "beam": 100, "starts": 16, "finalists": 2},
        # For clouds of which some 60 % of the source has a partner.
        "partial": {"overlap": 0.6, "starts": 128, "finalists": 12, "budget_ms": 2000.0},
    }

    def __init__(
        self,
        *,
        threshold: float = 1e-3,
        motion: Literal["full", "prior", "centred"] = "full",
        max_translation: float | None = None,
        overlap: float = 1.0,
        init: Literal["centroid", "identity"] = "centroid",
        cells: int = 48,
        beam: int = 300,
        starts: int = 32,
        finalists: int = 4,
        max_points: int = 1000,
        max_nodes: int | None = None,
        budget_ms: float | None = 500.0,
    ) -> None:
        self.threshold = threshold
        self.motion = motion
        self.max_translation = max_translation
        self.overlap = overlap
        self.init = init
        self.cells = cells
        self.beam = beam
        self.starts = starts
        self.finalists = finalists
        self.max_points = max_points
        self.max_nodes = max_nodes
        self.budget_ms = budget_ms

    def prepare(self) -> None:
        """Load the compiled kernels; the first time on a machine they are compiled, which takes a minute or two."""
        load_kernels(trimmed=self.overlap < 1)

    def register(self, problem: Problem, *, progress: Progress | None = None) -> Registration:
        """Estimate T_target_source.

        Args:
            problem: The clouds.
            progress: Called about a hundred times a second of branch and bound, with the least mean squared error so
                far, the bound under every error, both in squared extents of the target, and the cells of rotations
                looked at.

        Returns:
            The `confidence` is minus the root of the mean squared error, in extents of the target.

        Raises:
            ValueError: A cloud has no points, the source is very much larger than the target, or a parameter is out of
                range.
        """
        if not 0 < self.overlap <= 1:
            raise ValueError(f"overlap is a share in (0, 1], got {self.overlap}")
        if not self.threshold > 0:
            raise ValueError(f"threshold must be above 0, got {self.threshold}")
        for name, least in (("beam", 0), ("finalists", 0), ("starts", 1), ("max_points", 1), ("cells", 2)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, got {getattr(self, name)}")
        for name in ("max_translation", "max_nodes", "budget_ms"):
            value = getattr(self, name)
            if value is not None and not value >= 0:
                raise ValueError(f"{name} must be at least 0, got {value}")
        load_kernels(trimmed=self.overlap < 1)
        frame = LocalFrame.of(problem)
        require_like_sizes(frame)
        prior = problem.motion_prior if self.motion == "prior" else None
        starts = [start_of(problem, frame, self.init)]
        if prior is not None:
            starts.append(se3(prior.mean_T_target_source()[:3, :3], np.zeros(3)))
        found = search(
            frame.source, frame.target, starts, self._settings(frame, prior), seed=problem.seed, progress=progress
        )
        return self._registration(frame, found)

    def _settings(self, frame: LocalFrame, prior: MotionPrior | None) -> Settings:
        return Settings(
            threshold=self.threshold,
            overlap=self.overlap,
            euler_rad=None if prior is None else _box(np.radians(prior.angle_min_deg), np.radians(prior.angle_max_deg)),
            translation=self._translation(frame, prior),
            cells=self.cells,
            beam=self.beam,
            starts=self.starts,
            finalists=self.finalists,
            max_points=self.max_points,
            max_nodes=self.max_nodes,
            budget_s=None if self.budget_ms is None else self.budget_ms / 1000,
        )

    def _translation(self, frame: LocalFrame, prior: MotionPrior | None) -> Box | None:
        """Return the range of translations in the local frame, or None for all."""
        if self.motion == "centred":
            return Box(middle=np.zeros(3), half=np.zeros(3))
        if prior is not None:
            # In the problem's frames t = t_local unit + target_centroid - R source_centroid, and R is not known.
            reach = np.linalg.norm(frame.source_centroid)
            low, high = np.array(prior.translation_min) - reach, np.array(prior.translation_max) + reach
            return _box((low - frame.target_centroid) / frame.unit, (high - frame.target_centroid) / frame.unit)
        if self.max_translation is not None:
            return Box(middle=np.zeros(3), half=np.full(3, self.max_translation))
        return None

    def _registration(self, frame: LocalFrame, found: Found) -> Registration:
        certified = found.gap <= self.threshold * (1 + 1e-6)
        return Registration(
            T_target_source=frame.from_local(found.T_target_source),
            converged=certified,
            iterations=found.nodes,
            confidence=-(found.error**0.5),
            facts={
                "certified": certified,
                "gap": found.gap,
                "error": found.error,
                "nodes": found.nodes,
                "points": found.points,
            },
        )


def _box(low: np.ndarray, high: np.ndarray) -> Box:
    return Box(middle=(low + high) / 2, half=(high - low) / 2)
