"""The trials of one method on one protocol, in columns: a million of them fit into memory and are summed up at once."""

from __future__ import annotations

import sys
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.report.motions import append_motion, first_not_rigid, unpacked
from regbench.runner.status import Status

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
STATUSES = tuple(Status)
OK = STATUSES.index(Status.OK)
IDENTITY = np.eye(4).ravel().tolist()
MOST = 2**31
_CODES: Mapping[Any, int] = {status.value: code for code, status in enumerate(STATUSES)}


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One row of the journal.

    Attributes:
        key: The journal's key.
        status: How it ended.
        T_target_source: 4x4 nested list; the identity where the trial failed, which is how it is scored.
        time_ms: Wall time, or NaN.
        cpu_ms: CPU time, or NaN.
        machine: Processor and number of cores of where it ran, or "" where the journal does not say.
    """

    key: str
    status: Status
    T_target_source: list[list[float]]
    time_ms: float
    cpu_ms: float
    machine: str


@dataclass(frozen=True, eq=False)
class Trials(Mapping[tuple[int, int], Trial]):
    """Trials by (problem, repeat), in that order.

    Attributes:
        problems: (n,) int64.
        repeats: (n,) int64.
        trial_keys: (n,) the journal's keys.
        codes: (n,) positions in STATUSES.
        T_target_source: (n, 4, 4) float64; the identity where the trial failed.
        time_ms: (n,) wall times, or NaN.
        cpu_ms: (n,) CPU times, or NaN.
        machines: (n,) where they ran, in words; "" where the journal does not say.
    """

    problems: Integers
    repeats: Integers
    trial_keys: NDArray[np.object_]
    codes: Integers
    T_target_source: Array
    time_ms: Array
    cpu_ms: Array
    machines: NDArray[np.object_]

    def __len__(self) -> int:
        return len(self.problems)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return zip(self.problems.tolist(), self.repeats.tolist(), strict=True)

    def __getitem__(self, key: tuple[int, int]) -> Trial:
        problem, repeat = key
        start, stop = np.searchsorted(self.problems, problem), np.searchsorted(self.problems, problem, side="right")
        position = start + np.searchsorted(self.repeats[start:stop], repeat)
        if position >= stop or self.repeats[position] != repeat:
            raise KeyError(key)
        return Trial(
            str(self.trial_keys[position]),
            STATUSES[self.codes[position]],
            self.T_target_source[position].tolist(),
            float(self.time_ms[position]),
            float(self.cpu_ms[position]),
            str(self.machines[position]),
        )

    @property
    def answered(self) -> NDArray[np.bool_]:
        """(n,) whether the status is ok."""
        return np.asarray(self.codes == OK)

    def failures(self) -> dict[str, int]:
        """Return how many trials failed by status, without those that do not occur."""
        counts = np.bincount(self.codes, minlength=len(STATUSES)).tolist()
        return {
            status.value: count
            for status, count in zip(STATUSES, counts, strict=True)
            if count and status is not Status.OK
        }

    def joined(self, later: Trials) -> Trials:
        """Return both; of a trial that both hold, the later one's."""
        columns = vars(self).keys()
        return _in_order(**{name: np.concatenate([getattr(self, name), getattr(later, name)]) for name in columns})


def _in_order(**columns: Any) -> Trials:
    """Return trials sorted by problem and repeat; of several of one trial the last."""
    problems, repeats = columns["problems"], columns["repeats"]
    order = np.lexsort((repeats, problems))  # stable
    next_is_other = (np.diff(problems[order]) != 0) | (np.diff(repeats[order]) != 0)
    order = order[np.append(next_is_other, np.ones(min(len(order), 1), dtype=bool))]
    return Trials(**{name: column[order] for name, column in columns.items()})


class NotATrialError(Exception):
    """A line of a journal is no trial: its arguments are the line's number and why."""


class TrialsBuilder:
    """Takes rows one by one and keeps what a table needs of them: some 250 bytes a trial."""

    def __init__(self) -> None:
        self._lines, self._problems, self._repeats, self._codes = (array("q") for _ in range(4))
        self._motions, self._time_ms, self._cpu_ms = (array("d") for _ in range(3))
        self._keys: list[str] = []
        self._machines: list[str] = []

    def add(self, row: Mapping[str, Any], line: int) -> None:
        """Take a row of the journal; `line` is its number in the file.

        Raises:
            KeyError, TypeError, ValueError, OverflowError: It is not a trial. The builder is then not to be used.
        """
        code = _CODES.get(status := row["status"])
        if code is None:
            raise ValueError(f"{status!r} is not a valid Status")
        self._problems.append(_count(row["problem"]))
        self._repeats.append(_count(row["repeat"]))
        self._codes.append(code)
        self._lines.append(line)
        if code != OK:
            self._motions.extend(IDENTITY)
        elif not append_motion(self._motions, row["T_target_source"]):
            raise ValueError("status ok without a 4x4 T_target_source")
        time_ms, cpu_ms = row["time_ms"], row["cpu_ms"]
        self._time_ms.append(nan if time_ms is None else float(time_ms))
        self._cpu_ms.append(nan if cpu_ms is None else float(cpu_ms))
        self._keys.append(row["key"])
        self._machines.append(sys.intern(str(row.get("machine", ""))))  # one object for all rows

    def build(self) -> Trials:
        """Return what was taken, in order.

        Raises:
            NotATrialError: An answer is no motion, which the runner would not have let pass, or a time is negative.
        """
        T_target_source = unpacked(self._motions)
        if found := first_not_rigid(T_target_source):
            position, reason = found
            raise NotATrialError(self._lines[position], f"status ok, but T_target_source is not a motion: {reason}")
        time_ms, cpu_ms = (np.frombuffer(column, dtype=np.float64) for column in (self._time_ms, self._cpu_ms))
        if (negative := np.flatnonzero((time_ms < 0) | (cpu_ms < 0))).size:
            raise NotATrialError(self._lines[negative[0]], "a negative time")
        return _in_order(
            problems=np.frombuffer(self._problems, dtype=np.int64),
            repeats=np.frombuffer(self._repeats, dtype=np.int64),
            trial_keys=np.array(self._keys, dtype=object),
            codes=np.frombuffer(self._codes, dtype=np.int64),
            T_target_source=T_target_source,
            time_ms=time_ms,
            cpu_ms=cpu_ms,
            machines=np.array(self._machines, dtype=object),
        )


def _count(value: Any) -> int:
    """Return the number of a problem or a repeat, which fits NumPy's."""
    number = int(value)
    if not 0 <= number < MOST:
        raise ValueError("a problem's or a repeat's number is out of range")
    return number
