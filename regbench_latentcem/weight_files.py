"""Where the weights lie. Loads no torch: the runner asks which files a method's answers depend on."""

from __future__ import annotations

from pathlib import Path

from regbench.errors import UserError

FOLDER = Path(__file__).parent / "weights"
SUFFIX = ".safetensors"
DEFAULTS = {"paper": "modelnet40", "equivariant": "equivariant"}


def named(model: str, weights: str) -> str:
    """Return the name or path of a model's weights, with "default" resolved."""
    return DEFAULTS[model] if weights == "default" else weights


def matcher_path() -> Path:
    """Return the file of the fitted matcher."""
    return FOLDER / f"matcher{SUFFIX}"


def file_of(name: str) -> Path:
    """Return NAME.safetensors of this package, or the path itself where it ends so; there or not."""
    return Path(name) if name.endswith(SUFFIX) else FOLDER / f"{name}{SUFFIX}"


def weights_path(name: str) -> Path:
    """Return the file of weights: NAME.safetensors of this package, or the path itself where it ends so.

    Raises:
        UserError: There is no such file.
    """
    path = file_of(name)
    if path.is_file():
        return path
    if name.endswith(SUFFIX):
        raise UserError(f"latentcem: weights {path}: no such file")
    there = ", ".join(sorted(file.stem for file in FOLDER.glob(f"*{SUFFIX}"))) or "none yet"
    raise UserError(f"latentcem: no weights '{name}' in {FOLDER} (there: {there})")
