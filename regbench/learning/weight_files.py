"""Where a learned method's weights lie. Loads no torch: the runner asks which files a method's answers depend on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from regbench.errors import UserError

SUFFIX = ".safetensors"


@dataclass(frozen=True)
class WeightFiles:
    """The weight files that a method's package holds.

    Attributes:
        method: Its name, for messages.
        folder: Where they lie.
        default: The weights that the name "default" stands for.
    """

    method: str
    folder: Path
    default: str = "default"

    def file(self, name: str) -> Path:
        """Return NAME.safetensors of the folder, or the path itself where it ends so; there or not."""
        name = self.default if name == "default" else name
        return Path(name) if name.endswith(SUFFIX) else self.folder / f"{name}{SUFFIX}"

    def path(self, name: str) -> Path:
        """Return the file of weights; see `file`.

        Raises:
            UserError: There is no such file.
        """
        path = self.file(name)
        if path.is_file():
            return path
        if name.endswith(SUFFIX):
            raise UserError(f"{self.method}: weights {path}: no such file")
        there = ", ".join(sorted(file.stem for file in self.folder.glob(f"*{SUFFIX}"))) or "none yet"
        raise UserError(f"{self.method}: no weights '{name}' in {self.folder} (there: {there})")
