"""regbench doctor: what is ready, and why not."""

from __future__ import annotations

import json

from regbench.cli.options import Data, Json, Plugins


def doctor(data: Data = None, plugin: Plugins = None, as_json: Json = False) -> None:
    """Print versions, cores, GPU, and which methods and data are ready."""
    from regbench.doctor import examine

    report = examine(data, plugin or [])
    if as_json:
        print(json.dumps(report, indent=1))
        return
    for title, lines in report.items():
        print(title)
        width = max((len(name) for name in lines), default=0)
        for name, words in lines.items():
            print(f"  {name:{width}}  {words}")
