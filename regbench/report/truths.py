"""The ground truth of a protocol's problems, in columns."""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.errors import UserError
from regbench.geometry.se3 import why_not_rigid
from regbench.report.trials import LARGEST_TRANSLATION

Array = NDArray[np.float64]
UNKNOWN = [float("nan")] * 16


@dataclass(frozen=True, eq=False)
class Truths(Mapping[int, "Array | None"]):
    """T_target_source by problem; None where nobody knows it.

    Attributes:
        problems: (n,) int64, rising.
        T_target_source: (n, 4, 4) float64; NaN where nobody knows it.
    """

    problems: NDArray[np.int64]
    T_target_source: Array

    def __len__(self) -> int:
        return len(self.problems)

    def __iter__(self) -> Iterator[int]:
        return iter(self.problems.tolist())

    def __getitem__(self, problem: int) -> Array | None:
        position = int(np.searchsorted(self.problems, problem))
        if position == len(self) or self.problems[position] != problem:
            raise KeyError(problem)
        T = self.T_target_source[position]
        return None if np.isnan(T[0, 0]) else T

    def of(self, problems: NDArray[np.int64]) -> Array:
        """Return (k, 4, 4) ground truths of (k,) problems, each of which is here; NaN where nobody knows it."""
        return self.T_target_source[np.searchsorted(self.problems, problems)]

    def lacking(self, problems: NDArray[np.int64]) -> int | None:
        """Return the least of (k,) problems that is not here, or None."""
        lacking = problems[~np.isin(problems, self.problems)]
        return int(lacking.min()) if lacking.size else None

    def joined(self, later: Truths) -> Truths:
        """Return both; of a problem that both hold, the later one's."""
        return _in_order(
            np.concatenate([self.problems, later.problems]),
            np.concatenate([self.T_target_source, later.T_target_source]),
        )


def no_truths() -> Truths:
    """Return none."""
    return Truths(np.empty(0, dtype=np.int64), np.empty((0, 4, 4)))


def _in_order(problems: NDArray[np.int64], T_target_source: Array) -> Truths:
    """Return truths sorted by problem; of several of one problem the last."""
    order = np.argsort(problems, kind="stable")
    order = order[np.append(np.diff(problems[order]) != 0, np.ones(min(len(order), 1), dtype=bool))]
    return Truths(problems[order], T_target_source[order])


def read_truths(path: Path) -> dict[str, Truths]:
    """Return the ground truth of every problem by protocol id.

    Raises:
        UserError: The file cannot be read, or a line is not a problem.
    """
    problems: dict[str, array[int]] = {}
    motions: dict[str, array[float]] = {}
    try:
        with path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                protocol, problem, T = _parse(path, number, line)
                if protocol not in problems:
                    problems[protocol], motions[protocol] = array("q"), array("d")
                problems[protocol].append(problem)
                motions[protocol].extend(T)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); is this the folder of a run?") from error
    return {
        protocol: _in_order(
            np.frombuffer(problems[protocol], dtype=np.int64),
            np.frombuffer(motions[protocol], dtype=np.float64).reshape(-1, 4, 4),
        )
        for protocol in problems
    }


def _parse(path: Path, number: int, line: bytes) -> tuple[str, int, list[float]]:
    """Return a line's protocol, problem and 16 numbers."""
    try:
        row: dict[str, Any] = json.loads(line)
        protocol, problem, T = str(row["protocol"]), int(row["problem"]), row["T_target_source"]
        np.int64(problem)
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise UserError(f"{path}: line {number} is not a problem; the file was damaged") from None
    if T is None:
        return protocol, problem, UNKNOWN
    if reason := why_not_rigid(T):
        raise UserError(f"{path}: line {number}: T_target_source is not a motion: {reason}")
    numbers = [float(value) for row_of_T in T for value in row_of_T]
    if max(map(abs, numbers)) >= LARGEST_TRANSLATION:
        raise UserError(f"{path}: line {number}: T_target_source is longer than any motion; the file was damaged")
    return protocol, problem, numbers
