"""The weight files that methods bring, with what their model cards say; a damaged one with its reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.learning.weight_files import SUFFIX
from regbench.learning.weights import load_weights

Entry = dict[str, Any]
# What an entry has of a card; "before" and "curve" where the training began from other weights and was validated.
KNOWN = ("steps", "hours", "before", "device", "monitor", "validation", "curve", "remark", "sha256")


def weights_in(folder: Path, method: str) -> list[Entry]:
    """Return an entry for each weight file of a folder.

    Args:
        folder: A Trainable's `recipes`.
        method: Its name.
    """
    return [_entry(path, method) for path in sorted(folder.glob(f"*{SUFFIX}"))]


def _entry(path: Path, method: str) -> Entry:
    entry: Entry = {"name": path.stem, "method": method, "path": str(path), "mb": path.stat().st_size / 1e6}
    try:
        weights = load_weights(path)
    except UserError as error:
        return {**entry, "ok": False, "reason": str(error)}
    card = weights.card
    known = {key: card.get(key) for key in KNOWN}
    parameters = sum(tensor.numel() for tensor in weights.tensors.values())
    return {**entry, "ok": True, "parameters": parameters, **known}


def words(entry: Entry) -> list[str]:
    """Return the cells of an entry's row of the table, in the order of `HEADER`."""
    head = [entry["name"], entry["method"]]
    if not entry["ok"]:
        return [*head, *[""] * (len(HEADER) - 3), f"damaged: {entry['reason']}"]
    figures, monitor = entry["validation"], entry["monitor"]
    has_figure = (
        isinstance(figures, dict) and isinstance(monitor, str) and isinstance(figures.get(monitor), int | float)
    )
    return [
        *head,
        f"{entry['parameters']:,}",
        f"{entry['mb']:.2f}",
        _number(entry["steps"], ",d"),
        _number(entry["hours"], ".2f"),
        str(entry["device"] or ""),
        f"{monitor} {figures[monitor]:.4g}" if has_figure else "",
        "ok",
    ]


HEADER = ("name", "method", "parameters", "MB", "steps", "hours", "device", "validation", "sha256")


def _number(value: Any, form: str) -> str:
    """Write a card's number; a card is a file, and may hold anything."""
    try:
        return format(value, form)
    except (TypeError, ValueError):
        return "" if value is None else str(value)
