"""Names in figures: what is said of a method beside its name, and how a long one is broken."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from regbench.metrics.table import Metric

# After these a name is best broken.
JOINT = re.compile(r"[^,\[\]/= ]*[,\[\]/= ]*")


def method_words(method: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a method's name, with what no figure may hide: failures, missing trials, a look at the truth.

    Args:
        method: Its name.
        rows: As `summarise` gives them; those of other methods are passed over.
    """
    own = [row for row in rows if row["method"] == method]
    n, planned = sum(row["n"] for row in own), sum(row["planned"] for row in own)
    failed = sum(sum(row["failures"].values()) for row in own)
    remarks = [
        *(["sees the truth"] if any(row["sees_ground_truth"] for row in own) else []),
        *([f"{failed} of {n} failed"] if failed else []),
        *([f"{n} of {planned} trials"] if n < planned else []),
    ]
    return f"{printable(method)} ({'; '.join(remarks)})" if remarks else printable(method)


def printable(text: str) -> str:
    """Return text with a question mark for every character that has no shape."""
    return "".join(character if character.isprintable() else "?" for character in text)


def wrapped(text: str, width: int) -> str:
    """Return text on lines of at most so many characters, broken after a comma or the like where there is one."""
    lines = [""]
    for part in JOINT.findall(text):
        if lines[-1] and len(lines[-1]) + len(part.rstrip()) > width:
            lines.append("")
        lines[-1] += part
        while len(lines[-1].rstrip()) > width:
            lines[-1:] = [lines[-1][:width], lines[-1][width:]]
    return "\n".join(line.rstrip() for line in lines)


def axis_words(metric: Metric) -> str:
    """Return what an axis of a metric is called."""
    return f"{metric.name} ({metric.unit})"


def trial_words(metric: Metric) -> str:
    """Return what an axis of its values, one for each trial, is called: without the statistic."""
    name = re.sub(r" (mean|median|p\d+)$", "", metric.name)
    return f"{name} ({metric.unit.removesuffix(' median')})"
