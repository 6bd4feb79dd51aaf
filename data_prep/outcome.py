"""How a preparation says what it did, left out and found odd."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from regbench.errors import UserError


def reason(error: UserError, folder: Path) -> str:
    """Return an error's message with paths below `folder` shortened: manifests do not depend on where the data lay."""
    return str(error).replace(f"{folder}/", "")


def say_outcome(
    report: Callable[[str], None],
    name: str,
    what: str,
    left_out: Mapping[str, str],
    remarks: Mapping[str, str],
    *,
    changed: bool,
) -> None:
    """Report every item left out or odd by name, then one line on the whole."""
    for item, why in sorted(left_out.items()):
        report(f"left out: {item}: {why}")
    for item, remark in sorted(remarks.items()):
        report(f"note: {item}: {remark}")
    report(f"{name}: {what}, {len(left_out)} left out" + ("" if changed else "; already prepared, nothing changed"))
