"""What weights have cost: samples seen and hours, over the training that made them and those it started from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def training_budget(card: Mapping[str, Any]) -> dict[str, float]:
    """Return "samples" and "hours" of a model card, with those of earlier trainings, which its "before" counts.

    What was fitted without steps has 0 samples.

    Raises:
        KeyError, TypeError, AttributeError: The card is not a training's.
    """
    before = card.get("before") or {"samples": 0, "hours": 0.0}
    samples = card["steps"] * card["recipe"]["training"]["batch"] if card.get("steps") else 0
    return {"samples": samples + before["samples"], "hours": round(card["hours"] + before["hours"], 4)}


def hours_by_device(card: Mapping[str, Any]) -> dict[str, float]:
    """Return the hours of a model card, and of the trainings before it, on each device that they ran on.

    A "before" that names no devices is counted as of this training's own.

    Raises:
        KeyError, TypeError, AttributeError: The card is not a training's.
    """
    before = card.get("before") or {"hours": 0.0}
    device = str(card.get("device", "a device not stated"))
    found = {str(name): float(hours) for name, hours in before.get("hours_by_device", {}).items()}
    unnamed = before["hours"] if not found else 0.0
    found[device] = round(found.get(device, 0.0) + unnamed + card["hours"], 4)
    return found
