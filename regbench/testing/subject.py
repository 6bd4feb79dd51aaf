"""The method under test: how the battery builds it, asks it, and judges its answers."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem, Registrar
from regbench.geometry.se3 import invert, why_not_rigid
from regbench.geometry.size import extent
from regbench.testing.check_result import CheckFailed, CheckSkipped

CLOSE_DEG = 5.0
CLOSE_EXTENTS = 0.05


@dataclass(frozen=True)
class Origin:
    """Where another process finds a class again.

    Attributes:
        module: Name of its module.
        file: Path of its file, for a module that cannot be imported by name (a plugin file, a script).
        attribute: Name of the class within the module, dotted if it is nested.
    """

    module: str
    file: str
    attribute: str

    @classmethod
    def of(cls, method_class: type) -> Origin | None:
        """Return a class's origin, or None for a class made inside a function or typed into a prompt."""
        if "<locals>" in method_class.__qualname__:
            return None
        try:
            file = inspect.getfile(method_class)
        except (TypeError, OSError):
            return None
        return cls(method_class.__module__, str(Path(file).resolve()), method_class.__qualname__)

    def load(self) -> type:
        """Import the class."""
        from regbench.registry import import_file

        found: Any = importlib.import_module(self.module) if self._is_importable() else import_file(Path(self.file))
        for part in self.attribute.split("."):
            found = getattr(found, part)
        method_class: type = found
        return method_class

    def _is_importable(self) -> bool:
        """Return whether importing the module by name gives this very file."""
        try:
            spec = importlib.util.find_spec(self.module)
        except (ImportError, ValueError):  # no such parent package, or __main__
            return False
        return spec is not None and spec.origin is not None and Path(spec.origin).resolve() == Path(self.file)


@dataclass(frozen=True)
class Subject:
    """A method's class with the parameters to test it with; those not given keep their defaults."""

    method_class: type
    parameters: Mapping[str, object]

    def trait(self, name: str) -> Any:
        """Return an optional class attribute of the contract, or the contract's default."""
        return getattr(self.method_class, name, getattr(Registrar, name))

    def build(self) -> Any:
        """Return a new instance, prepared if it can be."""
        instance = self.method_class(**self.parameters)
        prepare = getattr(instance, "prepare", None)
        if callable(prepare):
            prepare()
        return instance

    def ask(self, instance: Any, problem: Problem, truth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the instance's (4, 4) answer, copied.

        Raises:
            CheckSkipped: The method declines the problem.
            CheckFailed: It answers no rigid motion.
        """
        skip = getattr(instance, "skip", None)
        if callable(skip) and (reason := skip(problem)):
            raise CheckSkipped(f"the method declines the problem: {reason}")
        if self.trait("sees_ground_truth"):
            registration = instance.register_with_truth(problem, truth)
        else:
            registration = instance.register(problem)
        if not hasattr(registration, "T_target_source"):
            raise CheckFailed(
                f"register must return a Registration with T_target_source, got {type(registration).__name__}"
            )
        if problem_in_words := why_not_rigid(registration.T_target_source):
            raise CheckFailed(f"T_target_source is no rigid motion: {problem_in_words}")
        return np.array(registration.T_target_source, dtype=np.float64)

    def require_close(
        self, what: str, answer: NDArray[np.float64], problem: Problem, truth: NDArray[np.float64]
    ) -> str:
        """Return how far an answer is from the truth, in words.

        Raises:
            CheckFailed: It is farther than 5 degrees, or 0.05 of the target's extent.
        """
        rotation_deg, translation = errors(answer, problem, truth)
        words = f"{what}: off by {rotation_deg:.2g} deg and {translation:.2g} extents"
        if rotation_deg > CLOSE_DEG or translation > CLOSE_EXTENTS:
            raise CheckFailed(f"{words} (allowed: {CLOSE_DEG:g} deg, {CLOSE_EXTENTS:g} extents)")
        return words


def errors(answer: NDArray[np.float64], problem: Problem, truth: NDArray[np.float64]) -> tuple[float, float]:
    """Return the angle (degrees) and how far the target's centroid is misplaced (extents) by a wrong answer."""
    from scipy.spatial.transform import Rotation

    rotation_deg = float(np.degrees(Rotation.from_matrix(truth[:3, :3].T @ answer[:3, :3]).magnitude()))
    # At the centroid, not at the origin: a small angle misplaces a far origin by much.
    centroid = problem.target.mean(axis=0)
    misplaced = answer @ invert(truth) @ np.append(centroid, 1.0)
    return rotation_deg, float(np.linalg.norm(misplaced[:3] - centroid)) / extent(problem.target)


def same_bits(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Return whether two answers are equal bit for bit."""
    return a.tobytes() == b.tobytes()


def difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> str:
    """Return in words how far two answers are apart."""
    return f"largest difference of an entry {np.abs(a - b).max():.2g}"


def loaded(module: str) -> Any:
    """Return a module that the process has imported already, or None."""
    return sys.modules.get(module)
