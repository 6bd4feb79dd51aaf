"""Which weights are which. Loads no torch: the runner asks which files a method's answers depend on."""

from __future__ import annotations

from pathlib import Path

from regbench.learning.weight_files import WeightFiles

FOLDER = Path(__file__).parent / "weights"
DEFAULTS = {"paper": "modelnet40", "equivariant": "equivariant"}


def named(model: str, weights: str) -> str:
    """Return the name or path of a model's weights, with "default" resolved."""
    return DEFAULTS[model] if weights == "default" else weights


def weight_files() -> WeightFiles:
    """Return the weight files of this package."""
    return WeightFiles("latentcem", FOLDER)


def matcher_path() -> Path:
    """Return the file of the fitted matcher."""
    return weight_files().file("matcher")
