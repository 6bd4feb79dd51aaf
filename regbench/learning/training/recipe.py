"""A training's recipe: one TOML file, what the command line says over it, and the file written back as resolved.

trains = "NAME"     # the method
[training]          # what the engine does: the fields of `Training`
[method]            # what the method's Trainable does, handed to it as it stands
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from regbench.datasets.readers.toml import read_toml
from regbench.errors import UserError
from regbench.learning.training.toml_text import toml_text
from regbench.suggest import unknown

TABLES = ("training", "method")


class Training(BaseModel):
    """The [training] table.

    Attributes:
        steps: Optimiser steps.
        batch: Samples in a step, over all devices together.
        seed: Of the initial weights, the samples and torch's generators.
        learning_rate: AdamW's, at its highest.
        weight_decay: AdamW's.
        warm_up_steps: Steps in which the learning rate rises linearly from 0.
        schedule: What follows: "cosine", down to `final_learning_rate` at the last step; or "constant".
        final_learning_rate: As a fraction of `learning_rate`; for "cosine".
        clip_gradient_norm: Largest norm of the gradient; 0: not clipped.
        precision: Lightning's word: "32-true", "64-true", "bf16-true", "bf16-mixed" or "16-mixed".
        deterministic: On CUDA, use only kernels whose results do not vary from run to run. Slower.
        average: Decay of the exponential moving average of the weights, which is then what is validated and shipped;
            0: none. At step s the decay is at most (1 + s) / (10 + s), so that the start is soon forgotten.
        log_every: Steps in a row of the log.
        validate_every: Steps between validations; the last step is always validated.
        checkpoint_every: Steps between checkpoints; an interrupt and the last step always leave one.
        loader_workers: Processes that make samples; 0: the training's own. Results do not depend on it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    steps: int = Field(1000, ge=1)
    batch: int = Field(16, ge=1)
    seed: int = Field(0, ge=0, lt=2**63)
    learning_rate: float = Field(1e-3, gt=0, allow_inf_nan=False)
    weight_decay: float = Field(0.0, ge=0, allow_inf_nan=False)
    warm_up_steps: int = Field(0, ge=0)
    schedule: Literal["cosine", "constant"] = "cosine"
    final_learning_rate: float = Field(0.0, ge=0, le=1)
    clip_gradient_norm: float = Field(0.0, ge=0, allow_inf_nan=False)
    precision: Literal["32-true", "64-true", "bf16-true", "bf16-mixed", "16-mixed"] = "32-true"
    deterministic: bool = False
    average: float = Field(0.0, ge=0, lt=1)
    log_every: int = Field(50, ge=1)
    validate_every: int = Field(500, ge=1)
    checkpoint_every: int = Field(500, ge=1)
    loader_workers: int = Field(0, ge=0)


@dataclass(frozen=True)
class Recipe:
    """A recipe as it was resolved.

    Attributes:
        trains: The method's name.
        training: The [training] table, every field with a value.
        method: The [method] table as it stands.
    """

    trains: str
    training: Training
    method: Mapping[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """Return the recipe as TOML and JSON can hold it."""
        return {"trains": self.trains, "training": self.training.model_dump(), "method": dict(self.method)}

    def as_toml(self) -> str:
        """Return the recipe as the text of a TOML file.

        Raises:
            UserError: A setting is of a type that a model card cannot hold, such as a date.
        """
        return toml_text(self.as_dict())


Table = TypeVar("Table", bound=BaseModel)


def read_table(model: type[Table], values: Mapping[str, Any], where: str) -> Table:
    """Return a table of a recipe as its pydantic model.

    Args:
        model: Its fields are the table's keys.
        values: The table.
        where: Begins the message, e.g. "recipe small.toml: [training]".

    Raises:
        UserError: An unknown key (with a did-you-mean), or a value that its field cannot have.
    """
    for key in values:
        if key not in model.model_fields:
            raise UserError(f"{where} {unknown('key', key, model.model_fields)}")
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        problem = error.errors()[0]
        key = ".".join(str(part) for part in problem["loc"])
        value = "" if problem["type"] == "missing" or not key else f" = {problem['input']!r}"
        raise UserError(f"{where} {key or 'values'}{value}: {problem['msg'][:1].lower()}{problem['msg'][1:]}") from None


def load_recipe(path: Path, name: str, changes: Sequence[tuple[str, Any]] = ()) -> Recipe:
    """Read a recipe.

    Args:
        path: The TOML file.
        name: The method that it must be for.
        changes: Values over the file's, e.g. ("training.steps", 100) or ("method.width", 64).

    Raises:
        UserError: The file cannot be read, is for another method, or has a key or value that it cannot have.
    """
    return recipe_of(read_toml(path), name, f"recipe {path}:", changes)


def recipe_of(values: Mapping[str, Any], name: str, where: str, changes: Sequence[tuple[str, Any]] = ()) -> Recipe:
    """Return the recipe of a TOML file's content; see `load_recipe`."""
    keys = ("trains", *TABLES)
    for key in values:
        if key not in keys:
            raise UserError(f"{where} {unknown('key', key, keys)}")
    if values.get("trains") != name:
        raise UserError(
            f'{where} trains = {values.get("trains")!r}, not "{name}"; the first line says for which method'
        )
    tables: dict[str, dict[str, Any]] = {}
    for table in TABLES:
        if not isinstance(values.get(table, {}), dict):
            raise UserError(f"{where} {table} = {values[table]!r} is not a table; write [{table}]")
        tables[table] = dict(values.get(table, {}))
    for key, value in changes:
        _change(tables, key, value)
    recipe = Recipe(name, read_table(Training, tables["training"], f"{where} [training]"), tables["method"])
    recipe.as_toml()  # what cannot be written back is refused now, not after an hour
    return recipe


def parse_change(text: str) -> tuple[str, Any]:
    """Read `training.learning_rate=3e-4` into its key and its value, a TOML value or else plain text.

    Raises:
        UserError: There is no "=" or no table in it.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or key.partition(".")[0] not in TABLES or not key.partition(".")[2]:
        raise UserError(f"--set {text}: write training.KEY=VALUE or method.KEY=VALUE")
    try:
        return key, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key, value


def _change(tables: dict[str, dict[str, Any]], key: str, value: Any) -> None:
    *above, last = key.split(".")
    table: dict[str, Any] = tables
    for part in above:
        inner = table.get(part, {})
        if not isinstance(inner, dict):
            raise UserError(f"--set {key}: {part} = {inner!r} is not a table")
        table[part] = dict(inner)
        table = table[part]
    table[last] = value
