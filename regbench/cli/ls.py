"""regbench ls: what there is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from regbench.cli.options import Data, Json, Plugins

What = Literal["methods", "protocols", "datasets", "metrics"]


def ls(
    what: Annotated[What, typer.Argument(help="What to list.")],
    as_json: Json = False,
    plugin: Plugins = None,
    data: Data = None,
) -> None:
    """List methods, protocols, datasets or metrics. What cannot be used is listed with its reason."""
    from regbench import inventory

    listings: dict[str, Any] = {
        "methods": lambda: inventory.methods([Path(path) for path in plugin or []]),
        "protocols": lambda: inventory.protocols(data),
        "datasets": lambda: inventory.datasets(data),
        "metrics": inventory.metrics,
    }
    rows = listings[what]()
    if as_json:
        print(json.dumps(rows, indent=1))
        return
    width = max((len(row["name"]) for row in rows), default=0)
    for row in rows:
        print(f"{row['name']:{width}}  {row['summary']}")
