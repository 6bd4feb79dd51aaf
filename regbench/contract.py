"""The contract: all that a method's author must know.

A method is a class with a `name` and a `register(problem)` that returns a `Registration`. Deriving from `Registrar`
is a convenience: it documents what else a method may say about itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]


def _read_only_points(name: str, values: ArrayLike) -> Points:
    """Return a read-only, C-ordered (N, 3) float64 copy, or raise ValueError that names the argument."""
    points = np.array(values, dtype=np.float64, order="C")
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"{name} must have shape (N, 3), got {points.shape}")
    if not np.isfinite(points).all():
        raise ValueError(f"{name} has values that are not finite")
    points.flags.writeable = False
    return points


@dataclass(frozen=True)
class MotionPrior:
    """What a protocol discloses of the motion's range: uniform Euler angles and translations per axis.

    Attributes:
        angle_min_deg: Least angle about x, y, z in degrees, for R = Rx Ry Rz on column vectors.
        angle_max_deg: Greatest angle about x, y, z in degrees.
        translation_min: Least translation along x, y, z, in the clouds' unit.
        translation_max: Greatest translation along x, y, z, in the clouds' unit.
    """

    angle_min_deg: tuple[float, float, float]
    angle_max_deg: tuple[float, float, float]
    translation_min: tuple[float, float, float]
    translation_max: tuple[float, float, float]

    def mean_T_target_source(self) -> NDArray[np.float64]:
        """Return the motion at the middle of every range, (4, 4) float64."""
        from regbench.geometry.se3 import rotation_from_euler_deg, se3

        angles_deg = (np.asarray(self.angle_min_deg) + np.asarray(self.angle_max_deg)) / 2
        translation = (np.asarray(self.translation_min) + np.asarray(self.translation_max)) / 2
        return se3(rotation_from_euler_deg(angles_deg), translation)


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem:
    """Two clouds to align. Frozen, its arrays read-only; no ground truth is reachable from it.

    Attributes:
        source: (N, 3) float64, the cloud to move.
        target: (M, 3) float64, the cloud to move it onto.
        source_normals: (N, 3) float64 unit normals, or None.
        target_normals: (M, 3) float64 unit normals, or None.
        init_T_target_source: (4, 4) float64 start that the problem gives, or None.
        motion_prior: What the protocol discloses of the motion's range, or None.
        seed: Seed for every random choice a method makes.
        threads: Number of threads the method may use.
        device: "cpu" or "cuda".

    Raises:
        ValueError: An array has the wrong shape or values that are not finite.
    """

    source: Points
    target: Points
    source_normals: Points | None = None
    target_normals: Points | None = None
    init_T_target_source: NDArray[np.float64] | None = None
    motion_prior: MotionPrior | None = None
    seed: int = 0
    threads: int = 1
    device: str = "cpu"

    def __post_init__(self) -> None:
        for name in ("source", "target", "source_normals", "target_normals"):
            if (values := getattr(self, name)) is not None:
                object.__setattr__(self, name, _read_only_points(name, values))
        for cloud, normals in (("source", self.source_normals), ("target", self.target_normals)):
            if normals is not None and len(normals) != len(getattr(self, cloud)):
                raise ValueError(f"{cloud}_normals must have one row per point of {cloud}")
        if self.init_T_target_source is not None:
            init = np.array(self.init_T_target_source, dtype=np.float64)
            if init.shape != (4, 4) or not np.isfinite(init).all():
                raise ValueError("init_T_target_source must be a finite (4, 4) matrix")
            init.flags.writeable = False
            object.__setattr__(self, "init_T_target_source", init)


@dataclass(frozen=True, eq=False, kw_only=True)
class Registration:
    """A method's answer.

    Attributes:
        T_target_source: (4, 4) float64 rigid motion that maps source points into the target's frame.
        converged: Whether the method believes in its answer, or None if it cannot tell.
        iterations: Iterations used, or None.
        confidence: The method's own score of its answer, or None; its meaning is the method's.
        stages_s: Seconds spent in named stages, for the method's own insight.
        facts: Whatever else the method knows of its answer, by name: `{"certified": True, "gap": 3e-4}`.
    """

    T_target_source: NDArray[np.float64]
    converged: bool | None = None
    iterations: int | None = None
    confidence: float | None = None
    stages_s: Mapping[str, float] = field(default_factory=dict)
    facts: Mapping[str, bool | int | float] = field(default_factory=dict)


class Registrar:
    """A method. Write `register`; everything else has a default.

    Constructor arguments are keyword-only, with defaults, and stored unchanged under their own names: nothing else
    happens in `__init__`. So a method can be printed, hashed and swept: `--method "icp[max_distance=0.1,0.5]"`.
    Import heavy packages inside `prepare` and `register`, not at the top of the module: `regbench ls` reads the
    module too.

    Attributes:
        name: What `--method` calls it.
        version: Changes when answers change; part of a trial's key.
        kind: "classical", "learned" or "sentinel"; tables show sentinels apart.
        deterministic: Same problem, same seed, same bits. `regbench check` measures the claim.
        requires: Modules that must be importable. One that is not gives the status `missing`, not an error.
        presets: Named parameter sets, chosen by `name[preset=...]`. Lengths are relative to the cloud's extent or
            its spacing, never metres.
        sees_ground_truth: For the oracle alone: the runner then calls `register_with_truth(problem, T_target_source)`.
            Every table marks such a row.
    """

    name: ClassVar[str]
    version: ClassVar[str] = "1"
    kind: ClassVar[str] = "classical"
    deterministic: ClassVar[bool] = True
    requires: ClassVar[Sequence[str]] = ()
    presets: ClassVar[Mapping[str, Mapping[str, object]]] = {}
    sees_ground_truth: ClassVar[bool] = False

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source for one problem."""
        raise NotImplementedError

    def prepare(self) -> None:
        """Load weights, compile: done once in the worker, outside the clock."""

    def warm_up(self, problem: Problem) -> None:
        """Run once on a first problem, outside the clock. Registers it and drops the answer unless overridden."""
        self.register(problem)

    def skip(self, problem: Problem) -> str | None:
        """Return why this problem is not for this method, or None. A skip is a row with its reason."""
        return None

    def data_files(self) -> Sequence[Path]:
        """Return the files, such as weights, that the answers depend on: where one changes, rows are made anew."""
        return ()

    def training(self) -> str | None:
        """Return how the weights in use were trained, in a few words: supervision and budget. Tables print it."""
        return None

    def __repr__(self) -> str:
        from regbench.parameters import parameters_of

        arguments = ", ".join(f"{key}={value!r}" for key, value in parameters_of(self).items())
        return f"{type(self).__name__}({arguments})"
