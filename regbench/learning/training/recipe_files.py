"""Finds the recipe that is asked for: a file, or one that lies beside the method's weights."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from regbench.errors import UserError
from regbench.suggest import unknown

if TYPE_CHECKING:
    from regbench.learning.training.trainable import Trainable


def find_recipe(trainable: type[Trainable], name: str, asked: str | None) -> Path:
    """Return the path of a recipe.

    Args:
        trainable: The method; its recipes lie in its folder `recipes`.
        name: The method's name.
        asked: A path (it ends in .toml), a name in that folder, or None for the method's default.

    Raises:
        UserError: There is no such recipe, or none is named where there is no default.
    """
    if asked is not None and asked.endswith(".toml"):
        return Path(asked)
    folder = trainable.recipes
    there = {path.stem: path for path in sorted(folder.glob("*.toml"))} if folder is not None else {}
    if asked is None:
        asked = trainable.default_recipe or (next(iter(there)) if len(there) == 1 else None)
    if asked is None:
        names = f"(there: {', '.join(there)})" if there else "FILE.toml (the method brings none)"
        raise UserError(f"train {name}: name a recipe: --recipe {names}")
    if asked not in there:
        raise UserError(unknown("recipe", asked, there, of=f"method '{name}'") + "; a file's name ends in .toml")
    return there[asked]
