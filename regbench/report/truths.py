"""The ground truth of a protocol's problems, in columns."""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.errors import UserError
from regbench.geometry.se3 import why_not_rigid
from regbench.json_lines import parse_json
from regbench.report.motions import append_motion, first_not_rigid, unpacked

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

    def differing(self, other: Truths) -> int | None:
        """Return the least of the problems that both hold whose truths are not the same, or None."""
        both, mine, theirs = np.intersect1d(self.problems, other.problems, assume_unique=True, return_indices=True)
        ours, others = self.T_target_source[mine], other.T_target_source[theirs]
        same = (ours == others) | (np.isnan(ours) & np.isnan(others))
        differing = both[~same.all(axis=(1, 2))]
        return int(differing[0]) if differing.size else None

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


class _NoMotionError(Exception):
    """What stands for a ground truth is no motion: its arguments are the line's number and why."""


class _TruthsBuilder:
    """Takes the problems of one protocol one by one."""

    def __init__(self) -> None:
        self._problems, self._lines, self._known = (array("q") for _ in range(3))
        self._motions = array("d")

    def add(self, row: Mapping[str, Any], line: int) -> None:
        """Take a line of problems.jsonl; `line` is its number.

        Raises:
            KeyError, TypeError, ValueError, OverflowError: It is not a problem. The builder is then not to be used.
            _NoMotionError: Its truth is no 4x4 matrix.
        """
        self._problems.append(int(row["problem"]))
        self._lines.append(line)
        T = row["T_target_source"]
        self._known.append(T is not None)
        if T is None:
            self._motions.extend(UNKNOWN)
        elif not append_motion(self._motions, T):
            raise _NoMotionError(line, why_not_rigid(T))

    def build(self) -> Truths:
        """Return what was taken, in order.

        Raises:
            _NoMotionError: A truth is not rigid, or longer than any motion.
        """
        T_target_source = unpacked(self._motions)
        known = np.flatnonzero(np.frombuffer(self._known, dtype=np.int64))
        if found := first_not_rigid(T_target_source[known]):
            position, reason = found
            raise _NoMotionError(self._lines[known[position]], reason)
        return _in_order(np.frombuffer(self._problems, dtype=np.int64), T_target_source)


def read_truths(path: Path) -> dict[str, Truths]:
    """Return the ground truth of every problem by protocol id.

    Raises:
        UserError: The file cannot be read, or a line is not a problem.
    """
    builders: defaultdict[str, _TruthsBuilder] = defaultdict(_TruthsBuilder)
    try:
        with path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                try:
                    row = parse_json(line)
                    builders[str(row["protocol"])].add(row, number)
                except (ValueError, KeyError, TypeError, OverflowError):
                    raise UserError(f"{path}: line {number} is not a problem; the file was damaged") from None
        return {protocol: builder.build() for protocol, builder in builders.items()}
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); is this the folder of a run?") from error
    except _NoMotionError as error:
        line_number, reason = error.args
        raise UserError(f"{path}: line {line_number}: T_target_source is not a motion: {reason}") from None
