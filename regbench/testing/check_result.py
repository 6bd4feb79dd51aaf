"""How a check ended, and how a check says so."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Outcome(StrEnum):
    """How a check ended."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


@dataclass(frozen=True)
class CheckResult:
    """One check of the battery.

    Attributes:
        name: The check's name.
        outcome: How it ended.
        detail: In words: what was measured, what is wrong, or why it was skipped.
    """

    name: str
    outcome: Outcome
    detail: str


class CheckFailed(Exception):  # noqa: N818 - reads as what happened: `raise CheckFailed("...")`
    """Raised by a check: the method does not hold, with the reason in words."""


class CheckSkipped(Exception):  # noqa: N818
    """Raised by a check: it does not apply to this method, with the reason in words."""
