"""What there is: methods, protocols, datasets, metrics, each with a line or the reason it cannot be used."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from regbench import registry
from regbench.datasets.store import data_dir
from regbench.errors import UserError
from regbench.parameters import defaults_of

Entry = dict[str, Any]


def methods(plugins: Sequence[Path] = ()) -> list[Entry]:
    """Return every method; a plugin file that does not import is an entry too, with its reason."""
    usable: list[Path] = []
    entries: list[Entry] = []
    for path in plugins:
        try:
            registry.load_plugin(path)
            usable.append(path)
        except UserError as error:
            entries.append({"name": str(path), "ready": False, "summary": f"not ready: {error}"})
    found = registry.MethodRegistry(usable)
    return [_method(found, name) for name in found.names()] + entries


def _method(found: registry.MethodRegistry, name: str) -> Entry:
    try:
        method = found.resolve(registry.MethodSpec(name, name))
    except UserError as error:
        return {"name": name, "ready": False, "summary": f"not ready: {error}"}
    missing = method.missing()
    line = _first_line(method.cls)
    return {
        "name": name,
        "ready": not missing,
        "summary": f"not ready: needs {', '.join(missing)}" if missing else f"{line} [{method.trait('kind')}]",
        "kind": method.trait("kind"),
        "deterministic": method.trait("deterministic"),
        "presets": ["default", *method.trait("presets")],
        "parameters": defaults_of(method.cls),
    }


def _first_line(thing: object) -> str:
    return (inspect.getdoc(thing) or "").split("\n", 1)[0]


def protocols(data: Path | None) -> list[Entry]:
    """Return every protocol, and whether its data are ready."""
    entries = []
    for name in registry.names(registry.PROTOCOLS):
        try:
            protocol = registry.find_protocol(name)
            count = len(protocol.open(data_dir(data)))
        except UserError as error:
            entries.append({"name": name, "ready": False, "summary": f"not ready: {error}"})
        else:
            summary = f"{protocol.description} ({count} problems)"
            entries.append({"name": name, "ready": True, "summary": summary, "problems": count})
    return [*entries, {"name": "pairs:DIR", "ready": True, "summary": "your own pairs: cloud files and a pairs.csv"}]


def datasets(data: Path | None) -> list[Entry]:
    """Return every dataset, and whether it is prepared."""
    entries = []
    for name in registry.names(registry.DATASETS):
        try:
            dataset = registry.open_dataset(name, data_dir(data))
        except UserError as error:
            entries.append({"name": name, "ready": False, "summary": f"not ready: {error}"})
        else:
            sizes = {split: list(clouds.points.shape[:2]) for split, clouds in dataset.splits.items()}
            words = ", ".join(f"{split} {count} x {points} points" for split, (count, points) in sizes.items())
            summary = f"{dataset.description}: {words}"
            entry = {"name": name, "ready": True, "summary": summary, "splits": sizes, "sha256": dataset.sha256}
            entries.append(entry)
    return entries


def metrics() -> list[Entry]:
    """Return every metric."""
    from regbench.metrics.table import METRICS

    return [
        {
            "name": metric.key,
            "summary": f"{metric.name}: {metric.source} ({'higher' if metric.higher_is_better else 'lower'} is better)",
        }
        for metric in METRICS.values()
    ]
