"""What a run's folder says of its problems beside the truth: category and name of the shape or frames."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from regbench.errors import UserError


@dataclass(frozen=True)
class ProblemName:
    """Category (or scene) of a problem and the name of what it was made from, "" where unknown."""

    label: str = ""
    id: str = ""


def problem_names(run_dirs: Iterable[Path]) -> dict[tuple[str, int], ProblemName]:
    """Return the names by protocol id and problem; where folders differ, the later one's.

    Raises:
        UserError: A problems.jsonl cannot be read.
    """
    names = {}
    for run_dir in run_dirs:
        path = run_dir / "problems.jsonl"
        try:
            lines = path.read_bytes().splitlines()
            for line in lines:
                row = json.loads(line)
                key = str(row["protocol"]), int(row["problem"])
                names[key] = ProblemName(str(row.get("label") or ""), str(row.get("id") or ""))
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror}); is this the folder of a run?") from error
        except (ValueError, KeyError, TypeError, AttributeError):
            raise UserError(f"{path}: a line is not a problem; the file was damaged") from None
    return names
