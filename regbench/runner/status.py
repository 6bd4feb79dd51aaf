"""How a trial can end: one closed set, each with the words and the colour that a reader sees."""

from __future__ import annotations

from enum import StrEnum


class Status(StrEnum):
    """How a trial ended. Every trial is a row, whatever its status."""

    OK = "ok"
    INVALID = "invalid"
    ERROR = "error"
    TIMEOUT = "timeout"
    CRASHED = "crashed"
    OOM = "oom"
    SKIPPED = "skipped"
    MISSING = "missing"


MEANING = {
    Status.OK: "answered a rigid motion",
    Status.INVALID: "answered something that is not finite or not in SE(3)",
    Status.ERROR: "raised an exception",
    Status.TIMEOUT: "did not answer in time and was killed",
    Status.CRASHED: "its process died",
    Status.OOM: "went over the memory limit",
    Status.SKIPPED: "declined the problem, with a reason",
    Status.MISSING: "needs a package that is not installed",
}

COLOUR = {
    Status.OK: "green",
    Status.INVALID: "red",
    Status.ERROR: "red",
    Status.TIMEOUT: "magenta",
    Status.CRASHED: "red",
    Status.OOM: "magenta",
    Status.SKIPPED: "yellow",
    Status.MISSING: "yellow",
}

FAILURES = frozenset(Status) - {Status.OK}
