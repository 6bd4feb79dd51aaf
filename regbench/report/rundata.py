"""What tables are made of: the trials of one or several run folders, one row each, against their ground truth."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.errors import UserError
from regbench.geometry.se3 import why_not_rigid
from regbench.report.manifest import Manifest, MethodInfo, ProtocolInfo, read_manifest
from regbench.runner.journal import read_rows
from regbench.runner.status import Status

Array = NDArray[np.float64]
Trials = dict[tuple[int, int], "Trial"]


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One row of the journal.

    Attributes:
        key: The journal's key.
        status: How it ended.
        T_target_source: 4x4 nested list; the identity where the trial failed, which is how it is scored.
        time_ms: Wall time, or NaN.
        cpu_ms: CPU time, or NaN.
    """

    key: str
    status: Status
    T_target_source: list[list[float]]
    time_ms: float
    cpu_ms: float


@dataclass(frozen=True, eq=False)
class Group:
    """The trials of one method on one protocol, in the order of problem and repeat.

    Attributes:
        method: The method.
        protocol: The protocol.
        repeat: How many times each problem was to be run.
        trials: By (problem, repeat).
        run_dirs: The folders they came from.
    """

    method: MethodInfo
    protocol: ProtocolInfo
    repeat: int
    trials: Trials
    run_dirs: tuple[Path, ...]

    @property
    def planned(self) -> int:
        """Number of trials that the run planned."""
        return self.protocol.n * self.repeat


@dataclass(frozen=True, eq=False)
class RunData:
    """One or several runs, ready to be summarised.

    Attributes:
        groups: Sections in the order of the protocols, rows in the order of the methods, as they were asked for.
        truths: Ground truth T_target_source by (protocol id, sha256) and problem; None where nobody knows it.
        stale: Rows left out because their method or protocol has changed since, or is not in the manifest.
        machines: Processors that the runs name.
    """

    groups: Sequence[Group]
    truths: Mapping[tuple[str, str], Mapping[int, Array | None]]
    stale: int
    machines: Sequence[str]


IDENTITY = np.eye(4).tolist()
MOST = 2**31
# What the runner let pass as rigid is well within; beyond them products of entries overflow.
LARGEST_COSINE, LARGEST_TRANSLATION = 1.1, 1e100


def read_run(run_dir: Path) -> RunData:
    """Read one run folder. Of several rows of one trial the last wins.

    Raises:
        UserError: A file is missing, damaged or not a run's.
    """
    manifest = read_manifest(run_dir)
    truths = _read_truths(run_dir / "problems.jsonl")
    trials, stale = _read_trials(run_dir / "trials.jsonl", manifest)
    groups = [
        Group(method, protocol, manifest.repeat, trials[method.method, protocol.id], (run_dir,))
        for protocol in manifest.protocols.values()
        for method in manifest.methods.values()
    ]
    for group in groups:
        known = truths.get(group.protocol.id, {})
        if unknown := {problem for problem, _ in group.trials} - set(known):
            raise UserError(
                f"{run_dir / 'problems.jsonl'}: has no problem {min(unknown)} of {group.protocol.id}, which "
                "trials.jsonl answers; the file was damaged or belongs to another run. Give the run's command again"
            )
    by_hash = {(info.id, info.sha256): truths.get(info.id, {}) for info in manifest.protocols.values()}
    return RunData(groups, by_hash, stale, manifest.machines)


def _read_trials(path: Path, manifest: Manifest) -> tuple[dict[tuple[str, str], Trials], int]:
    """Return the trials of the manifest's methods and protocols, and the number of stale rows left out."""
    trials: dict[tuple[str, str], Trials] = {
        (method, protocol): {} for method in manifest.methods for protocol in manifest.protocols
    }
    stale = 0
    for number, row in enumerate(read_rows(path), start=1):
        try:
            group = trials.get((row["method"], row["protocol"]))
            fresh = (
                group is not None
                and row["fingerprint"] == manifest.methods[row["method"]].fingerprint
                and row["protocol_sha256"] == manifest.protocols[row["protocol"]].sha256
            )
            if group is None or not fresh:
                stale += 1
                continue
            group[_count(row["problem"]), _count(row["repeat"])] = _trial(row)
        except (KeyError, TypeError, ValueError, OverflowError) as error:  # JSON's whole numbers have no end
            what = f"has no {error}" if isinstance(error, KeyError) else str(error)
            raise UserError(f"{path}: line {number} is not a trial ({what}); the file was damaged") from None
    return {key: dict(sorted(group.items())) for key, group in trials.items()}, stale


def _count(value: Any) -> int:
    """Return the number of a problem or a repeat, which fits NumPy's."""
    number = int(value)
    if not 0 <= number < MOST:
        raise ValueError("a problem's or a repeat's number is out of range")
    return number


def _trial(row: Mapping[str, Any]) -> Trial:
    status = Status(row["status"])
    T = IDENTITY
    if status is Status.OK:
        T = row["T_target_source"]
        if not _is_4x4(T):
            raise ValueError("status ok without a 4x4 T_target_source")
    time_ms, cpu_ms = (float("nan") if row[key] is None else float(row[key]) for key in ("time_ms", "cpu_ms"))
    return Trial(row["key"], status, T, time_ms, cpu_ms)


def _is_4x4(value: object) -> bool:
    """Look for 4x4 finite numbers, cheaply: thousands of rows; that it is rigid was the runner's to check."""
    if not (isinstance(value, list) and len(value) == 4 and all(isinstance(row, list) for row in value)):
        return False
    if not all(len(row) == 4 and all(math.isfinite(entry) for entry in row) for row in value):
        return False
    return all(max(map(abs, row[:3])) < LARGEST_COSINE and abs(row[3]) < LARGEST_TRANSLATION for row in value)


def _read_truths(path: Path) -> dict[str, dict[int, Array | None]]:
    """Return the ground truth of every problem by protocol id."""
    truths: dict[str, dict[int, Array | None]] = {}
    try:
        lines = path.read_bytes().splitlines()
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); is this the folder of a run?") from error
    for number, line in enumerate(lines, start=1):
        try:
            row = json.loads(line)
            protocol, problem, T = str(row["protocol"]), int(row["problem"]), row["T_target_source"]
        except (ValueError, KeyError, TypeError, OverflowError):
            raise UserError(f"{path}: line {number} is not a problem; the file was damaged") from None
        if T is not None and (reason := why_not_rigid(T)):
            raise UserError(f"{path}: line {number}: T_target_source is not a motion: {reason}")
        if T is not None and not _is_4x4(T):
            raise UserError(f"{path}: line {number}: T_target_source is longer than any motion; the file was damaged")
        truths.setdefault(protocol, {})[problem] = None if T is None else np.array(T, dtype=np.float64)
    return truths
