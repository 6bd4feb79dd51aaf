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
