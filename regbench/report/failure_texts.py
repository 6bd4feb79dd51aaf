"""What failed trials said: by status and text, how often, and where first."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from regbench.report.rundata import Group
from regbench.runner.status import Status

LONGEST_TEXT = 600


@dataclass(frozen=True)
class Failure:
    """Trials of one method on one protocol that failed alike: how, with which words, how many, the first problem."""

    method: str
    status: str
    text: str
    trials: int
    first_problem: int


def failures_of(groups: Iterable[Group], texts: dict[str, str]) -> list[Failure]:
    """Return the failures of some groups, for each method the most frequent first.

    Args:
        groups: Methods on a protocol.
        texts: What the failed trials said, by the journal's key (see `failure_texts`).
    """
    failures = []
    for group in groups:
        problems: dict[tuple[str, str], list[int]] = {}
        for (problem, _), trial in group.trials.items():
            if trial.status is not Status.OK:
                problems.setdefault((trial.status.value, texts.get(trial.key, "")), []).append(problem)
        found = [
            Failure(group.method.method, status, text, len(where), min(where))
            for (status, text), where in problems.items()
        ]
        failures += sorted(found, key=lambda failure: (-failure.trials, failure.status, failure.text))
    return failures


def failure_texts(run_dirs: Iterable[Path]) -> dict[str, str]:
    """Return the error texts of the journals' failed trials by key, each in one line and cut to LONGEST_TEXT.

    The journals are taken as read already (see rundata.py): a line that is no trial was refused there.
    """
    texts = {}
    for run_dir in run_dirs:
        with (run_dir / "trials.jsonl").open("rb") as journal:
            for line in journal:
                if b'"status":"ok"' in line or not line.endswith(b"\n"):  # the many are passed over unread
                    continue
                row = json.loads(line)
                words = " ".join(str(row.get("error") or "").split())
                texts[row["key"]] = words if len(words) <= LONGEST_TEXT else words[:LONGEST_TEXT] + " ..."
    return texts
