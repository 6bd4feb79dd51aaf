"""How weights were trained, in a few words for tables. Loads no torch."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from regbench.learning.budget import hours_by_device, training_budget


def training_words(weights: Path) -> str | None:
    """Return supervision and budget, such as "supervised, 64,000 samples, 1.2 h on AMD EPYC, 1 thread".

    Args:
        weights: The weight file; its card lies beside it.

    Returns:
        None where there is no card that can be read: then registering says what is wrong.
    """
    try:
        card: dict[str, Any] = json.loads(weights.with_suffix(".json").read_bytes())
        parts = [str(card.get("supervision", "supervision not stated"))]
        if "hours" in card:
            budget = training_budget(card)
            if budget["samples"]:
                parts.append(f"{budget['samples']:,} samples")
            devices = hours_by_device(card).items()
            parts.append(" and ".join(f"{_duration(hours)} on {device}" for device, hours in devices))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):  # a card is a file, and may hold anything
        return None
    return ", ".join(parts)


def _duration(hours: float) -> str:
    return f"{hours:.1f} h" if hours >= 1 else f"{60 * hours:.0f} min"
