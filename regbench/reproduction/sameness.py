"""Whether two runs gave the same answers, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from regbench.metrics.rotation import rotation_error_deg
from regbench.report.rundata import Group, RunData
from regbench.report.trials import Trial
from regbench.runner.rundir import read_json
from regbench.runner.status import Status

SHOWN = 5


@dataclass
class Comparison:
    """The trials of one method on one protocol, in one run and again.

    Attributes:
        method: Name of the method.
        protocol: Id of the protocol.
        same: How many ended alike, with the same 64 bits in every entry of the transform.
        answered: How many of these have a transform.
        moved: (problem, repeat) of those with another transform, and by how much: degrees, and length.
        otherwise: (problem, repeat) of those that ended otherwise: the status before and now.
        absent: How many of the first run's trials the second has no row of.
        why: What changed that their answers depend on, in words.
    """

    method: str
    protocol: str
    same: int = 0
    answered: int = 0
    moved: dict[tuple[int, int], tuple[float, float]] = field(default_factory=dict)
    otherwise: dict[tuple[int, int], tuple[Status, Status]] = field(default_factory=dict)
    absent: int = 0
    why: list[str] = field(default_factory=list)

    @property
    def is_same(self) -> bool:
        """Whether nothing differs and nothing is absent."""
        return not (self.moved or self.otherwise or self.absent)


def compare(before: RunData, after: RunData, limit: int | None = None) -> list[Comparison]:
    """Hold the trials of a run against those of the run that repeats it; `limit` as in `replay`."""
    again = {(group.method.method, group.protocol.id): group for group in after.groups}
    return [
        _compared(group, again.get((group.method.method, group.protocol.id)), limit)
        for group in before.groups
        if group.trials
    ]


def _compared(before: Group, after: Group | None, limit: int | None) -> Comparison:
    found = Comparison(before.method.method, before.protocol.id)
    if after is not None:
        if after.method.fingerprint != before.method.fingerprint:
            found.why.append("the method's source, parameters or weights have changed since")
        if after.protocol.sha256 != before.protocol.sha256:
            found.why.append("the protocol's problems are others: its data differ, or it has changed since")
    for key, trial in before.trials.items():
        if limit is not None and key[0] >= limit:
            continue
        other = after.trials.get(key) if after is not None else None
        if other is None:
            found.absent += 1
        elif other.status is not trial.status:
            found.otherwise[key] = (trial.status, other.status)
        elif _bits(other) == _bits(trial):
            found.same += 1
            found.answered += trial.status is Status.OK
        else:
            found.moved[key] = _distance(trial, other)
    return found


def _bits(trial: Trial) -> bytes:
    return np.array(trial.T_target_source, dtype=np.float64).tobytes()


def _distance(one: Trial, other: Trial) -> tuple[float, float]:
    """Return the angle in degrees and the length between two answers, which may be as little as a last bit."""
    A, B = np.array(one.T_target_source), np.array(other.T_target_source)
    return float(rotation_error_deg(A[None, :3, :3], B[None, :3, :3])[0]), float(np.linalg.norm(A[:3, 3] - B[:3, 3]))


def surroundings(before: Path, after: Path) -> list[str]:
    """Return what differs between the surroundings of two runs, in words: versions, commit, processor."""
    was, now = read_json(before / "manifest.json"), read_json(after / "manifest.json")
    versions = {**_table(was, "versions"), **_table(now, "versions")}
    places = [(name, "versions", name) for name in sorted(versions)]
    places += [("regbench's commit", "git", "commit"), ("processor", "hardware", "cpu")]
    words = []
    for what, key, part in places:
        old, new = (_table(manifest, key).get(part, "unknown") for manifest in (was, now))
        if old != new:
            words.append(f"{what} {old} -> {new}")
    return words


def _table(manifest: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return a table of a manifest; empty where it says nothing, as outside a git checkout."""
    value = manifest.get(key)
    return value if isinstance(value, dict) else {}


def in_words(comparisons: Sequence[Comparison], differing: Sequence[str]) -> str:
    """Return the report: a line for each method on each protocol, the verdict last."""
    lines = []
    for found in comparisons:
        total = found.same + len(found.moved) + len(found.otherwise) + found.absent
        lines.append(f"{found.method} on {found.protocol}: {found.same} of {total} trials the same")
        if found.moved:
            angle_deg, length = (max(column) for column in zip(*found.moved.values(), strict=True))
            where = _some([_place(*key) for key in found.moved])
            lines.append(f"  another transform, by up to {angle_deg:.2g} deg and {length:.2g}: {where}")
        if found.otherwise:
            where = _some([f"{_place(*key)} {a} -> {b}" for key, (a, b) in found.otherwise.items()])
            lines.append(f"  ended otherwise: {where}")
        if found.absent:
            lines.append(f"  without a row in the new run: {found.absent}")
        lines += [f"  {reason}" for reason in found.why]
    different = sum(not found.is_same for found in comparisons)
    if different:
        lines += [f"differs in the surroundings: {'; '.join(differing)}"] if differing else []
        lines.append(f"NOT the same: {different} of {len(comparisons)} rows of the table differ")
    else:
        lines += [f"though these differ: {'; '.join(differing)}"] if differing else []
        answered = any(found.answered for found in comparisons)
        lines.append(f"the same: {'every transform, bit for bit' if answered else 'no trial answered, in either run'}")
    return "\n".join(lines)


def _place(problem: int, repeat: int) -> str:
    return f"problem {problem}" + (f" repeat {repeat}" if repeat else "")


def _some(words: Sequence[str]) -> str:
    more = f" and {len(words) - SHOWN} more" if len(words) > SHOWN else ""
    return ", ".join(words[:SHOWN]) + more
