"""What runs say about weight files: the figures of the methods that took their answers from them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from regbench.registry import MethodRegistry, parse_methods
from regbench.report.merge import read_runs
from regbench.report.rundata import Group
from regbench.report.summary import summarise_group
from regbench.runner.fingerprint import method_fingerprint

KEYS = ("rre_median_deg", "rmse_r_deg", "mae_r_deg", "rmse_t", "mae_t", "recall_5deg", "time_median_ms")

# By method, then by protocol: the figures of a table's row, and the machine and settings that they come from.
Figures = dict[str, dict[str, dict[str, Any]]]


def figures_by_file(runs: Sequence[Path], registry: MethodRegistry) -> tuple[dict[Path, Figures], list[str]]:
    """Return the figures for every data file of the methods in the runs.

    Args:
        runs: Run folders.
        registry: The methods as they are here.

    Returns:
        The figures by file; and, in words, what was left out: rows with trials missing, and methods whose source,
        parameters or data files are not those that ran.

    Raises:
        UserError: A run cannot be read, or a method of it is unknown.
    """
    run = read_runs(runs)
    found: dict[Path, Figures] = {}
    left_out = []
    for group in run.groups:
        what = f"{group.method.method} on {group.protocol.id}"
        method = registry.resolve(parse_methods([group.method.method])[0])
        data_files = getattr(method.cls, "data_files", None)
        if data_files is None:
            continue
        if method_fingerprint(method) != group.method.fingerprint:
            left_out.append(f"{what}: the method or its weights have changed since it ran; run it again")
        elif len(group.trials) < group.planned:
            left_out.append(f"{what}: {len(group.trials)} of {group.planned} trials; give the run's command again")
        else:
            row = summarise_group(group, run, {})
            figures = {key: row[key] for key in ("n", "failures", *KEYS)} | {"machine": _machine(group, run.machines)}
            for file in data_files(method.cls(**method.parameters)):
                found.setdefault(file, {}).setdefault(group.method.method, {})[group.protocol.id] = figures
    return found, left_out


def _machine(group: Group, machines: Sequence[str]) -> str:
    return "; ".join(filter(None, [*machines, group.method.settings]))
