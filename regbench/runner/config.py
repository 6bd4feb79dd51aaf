"""Reads a run's configuration: a TOML file, and what the command line says over it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from regbench.datasets.readers.toml import read_toml
from regbench.errors import UserError
from regbench.runner.plan import RunConfig
from regbench.suggest import unknown


def load_config(path: Path | None, given: Mapping[str, Any]) -> RunConfig:
    """Return the configuration of a TOML file with the given options over it.

    Raises:
        UserError: The file cannot be read, or an option is unknown or has a value it cannot have.
    """
    values: dict[str, Any] = {}
    if path is not None:
        values = read_toml(path)
        for name in values:
            if name not in RunConfig.model_fields:
                raise UserError(f"{path}: " + unknown("option", name, RunConfig.model_fields))
        for name in ("method", "protocol", "plugin"):
            if isinstance(values.get(name), str):
                values[name] = [values[name]]
    values |= given
    if not values.get("method"):
        raise UserError("no method given; `regbench ls methods` lists them, e.g. --method icp,fgr")
    try:
        return RunConfig.model_validate(values)
    except ValidationError as error:
        problem = error.errors()[0]
        name = str(problem["loc"][0])
        where = f"{path}: {name}" if path is not None and name not in given else f"--{name}"
        raise UserError(f"{where} = {problem['input']!r}: {problem['msg'].lower()}") from error
