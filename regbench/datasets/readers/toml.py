"""TOML files."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from regbench.datasets.readers.checks import naming, read_bytes


def read_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file's tables.

    Raises:
        UserError: The file cannot be read or is not TOML; the message names the line.
    """
    # UnicodeDecodeError and TOMLDecodeError are ValueErrors; deep nesting exhausts the stack.
    with naming(path, "TOML file", ValueError, RecursionError):
        return tomllib.loads(read_bytes(path).decode("utf-8"))
