"""What a protocol is: a name, a version, and problems with their answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.contract import MotionPrior, Problem
from regbench.protocols.draws import derive_seed


@dataclass(frozen=True, eq=False, kw_only=True)
class Pair:
    """One problem of a protocol together with its answer.

    Attributes:
        source: (N, 3) float64.
        target: (M, 3) float64.
        T_target_source: (4, 4) float64 ground truth, or None where nobody knows it (a user's own pair).
        label: Category or scene name, for breakdowns.
        id: Name of the shape or frames that the pair was made from.
        clean_source: (N', 3) float64 whole cloud before noise and cropping, for the modified Chamfer distance.
        clean_target: (M', 3) float64 likewise, in the target's frame.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    T_target_source: NDArray[np.float64] | None
    label: str
    id: str
    clean_source: NDArray[np.float64]
    clean_target: NDArray[np.float64]


class ProblemSet(ABC):
    """A protocol opened on its data: problem i is the same alone, in a batch, on any machine, in any order."""

    motion_prior: MotionPrior | None = None
    data_sha256: str = ""

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of problems."""

    @abstractmethod
    def pair(self, index: int) -> Pair:
        """Return problem `index` with its answer."""

    def __iter__(self) -> Iterator[Pair]:
        return (self.pair(index) for index in range(len(self)))

    def problem(
        self, index: int, *, protocol: str, seed: int = 0, repeat: int = 0, threads: int = 1, device: str = "cpu"
    ) -> tuple[Problem, Pair]:
        """Return what a method may see of problem `index`, and the pair it was made from."""
        pair = self.pair(index)
        problem = Problem(
            source=pair.source,
            target=pair.target,
            motion_prior=self.motion_prior,
            seed=derive_seed(protocol, index, f"method seed {seed} repeat {repeat}") % 2**31,
            threads=threads,
            device=device,
        )
        return problem, pair


@dataclass(frozen=True, kw_only=True)
class Protocol(ABC):
    """A named, versioned problem set.

    Attributes:
        name: Without the version, e.g. "modelnet40/clean".
        version: Raised whenever a problem changes.
        description: One line.
        dataset: Name of the dataset it needs, or None.
        headline_metrics: The metrics that the protocol's paper prints.
        published: Column group of the paper's Table 1 that it stands beside, or None.
    """

    name: str
    version: int
    description: str
    dataset: str | None
    headline_metrics: tuple[str, ...] = ("rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t")
    published: str | None = None

    @property
    def id(self) -> str:
        """Name and version, e.g. "modelnet40/clean@1"."""
        return f"{self.name}@{self.version}"

    @abstractmethod
    def open(self, data_dir: Path) -> ProblemSet:
        """Open the problems.

        Raises:
            UserError: The dataset is not prepared in `data_dir`, or is not fit for the protocol.
        """
