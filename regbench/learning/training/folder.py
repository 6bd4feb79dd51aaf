"""The folder of a training, and whether a recipe may continue what lies in it."""

from __future__ import annotations

import fcntl
import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from regbench.datasets.readers.toml import read_toml
from regbench.errors import UserError
from regbench.learning.training.recipe import Recipe

RUNS = Path("runs")
# Keys of [training] on which no result depends.
FREE = frozenset({"loader_workers"})


@dataclass(frozen=True)
class TrainingFolder:
    """Paths of a training's folder.

    Attributes:
        path: The folder, `--out`.
        name: The method's name.
    """

    path: Path
    name: str

    @property
    def recipe(self) -> Path:
        """The recipe as resolved."""
        return self.path / "recipe.toml"

    @property
    def log(self) -> Path:
        """Losses and validation figures."""
        return self.path / "log.csv"

    @property
    def plot(self) -> Path:
        """The picture of the log."""
        return self.path / "losses.png"

    @property
    def checkpoints(self) -> Path:
        """Folder of the checkpoints."""
        return self.path / "checkpoints"

    @property
    def last(self) -> Path:
        """The checkpoint from which the training continues."""
        return self.checkpoints / "last.ckpt"

    @property
    def best(self) -> Path:
        """The checkpoint of the best validation so far."""
        return self.checkpoints / "best.ckpt"

    @property
    def weights(self) -> Path:
        """The weights of the best validation so far; their model card lies beside them."""
        return self.path / f"{self.name}.safetensors"

    def check(self, recipe: Recipe) -> None:
        """Check that the folder is new, or holds this very training.

        Raises:
            UserError: It holds something else, or another recipe.
        """
        if self.recipe.exists():
            self._check_same(recipe)
        elif self.path.is_dir() and any(path.name not in ("lock", "checkpoints") for path in self.path.iterdir()):
            raise UserError(f"{self.path}: is not empty and not a training; give another --out")

    def _check_same(self, recipe: Recipe) -> None:
        old, new = _flat(read_toml(self.recipe)), _flat(recipe.as_dict())
        changed = [key for key in {**old, **new} if old.get(key) != new.get(key) and key not in _FREE_KEYS]
        if not changed:
            return
        key = changed[0]
        was, now = (_words(values.get(key)) for values in (old, new))
        if changed == ["training.steps"]:
            if recipe.training.schedule == "constant" and new[key] > old[key]:
                return
            reason = "only more steps of a constant schedule continue it"
        else:
            reason = "give another --out, or the old recipe"
        raise UserError(f"{self.path}: holds a training with {key} = {was}, this one has {now}; {reason}")

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Make the folder, and keep it to this process.

        Raises:
            UserError: Another training writes to it, or it cannot be made.
        """
        try:
            self.checkpoints.mkdir(parents=True, exist_ok=True)
            file = (self.path / "lock").open("w")
        except OSError as error:
            raise UserError(f"{self.path}: cannot be made ({error.strerror})") from error
        with file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise UserError(f"{self.path}: another training is writing to it; give another --out") from None
            yield


_FREE_KEYS = frozenset(f"training.{key}" for key in FREE)


def default_folder(name: str, recipe_name: str, recipe: Recipe, start: Path | None) -> Path:
    """Return the folder of a training that names none: the same command finds its own again.

    Its name holds a hash of all that may not change when a training continues.
    """
    values = _flat(recipe.as_dict())
    longer = {"training.steps"} if recipe.training.schedule == "constant" else set()
    what = {key: value for key, value in values.items() if key not in _FREE_KEYS | longer}
    text = json.dumps([what, str(start)], sort_keys=True)
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "-", f"train-{name}-{recipe_name}").strip("-")
    return RUNS / f"{slug}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def _flat(values: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        flat |= _flat(value, f"{above}{key}.") if isinstance(value, Mapping) else {above + key: value}
    return flat


def _words(value: Any) -> str:
    return "its default" if value is None else json.dumps(value)
