"""What runs say about weight files: the figures of the methods that took their answers from them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from regbench.registry import MethodRegistry, parse_methods
from regbench.report.manifest import read_manifest
from regbench.report.rundata import Group, read_run
from regbench.report.summary import samples_of, summarise_group
from regbench.runner.fingerprint import method_fingerprint

KEYS = ("rre_median_deg", "rmse_r_deg", "mae_r_deg", "rmse_t", "mae_t", "recall_5deg", "time_median_ms")

# By method, protocol and device: the figures of a table's row, and the machine and settings that they come from.
Figures = dict[str, dict[str, dict[str, dict[str, Any]]]]


def figures_by_file(run_dirs: Sequence[Path], registry: MethodRegistry) -> tuple[dict[Path, Figures], list[str]]:
    """Return the figures for every data file of the methods in the runs.

    Args:
        run_dirs: Run folders; of two rows of one method, protocol and device the later one's count.
        registry: The methods as they are here.

    Returns:
        The figures by file; and, in words, what was left out: rows with trials missing, and methods whose source,
        parameters or data files are not those that ran.

    Raises:
        UserError: A run cannot be read, or a method of it is unknown.
    """
    found: dict[Path, Figures] = {}
    left_out = []
    for run_dir in run_dirs:
        manifest, run = read_manifest(run_dir), read_run(run_dir)
        for group in run.groups:
            method = registry.resolve(parse_methods([group.method.method])[0])
            data_files = getattr(method.cls, "data_files", None)
            files = data_files(method.cls(**method.parameters)) if data_files else ()
            if not files:
                continue
            if reason := _why_not(group, method_fingerprint(method)):
                left_out.append(f"{group.method.method} on {group.protocol.id}: {reason}")
                continue
            row = summarise_group(group, samples_of(group, run, {}), {})
            figures = {key: row[key] for key in ("n", "failures", *KEYS)}
            figures["machine"] = f"{' and '.join(manifest.machines)}; {group.method.settings}"
            for file in files:
                by_protocol = found.setdefault(file, {}).setdefault(group.method.method, {})
                by_protocol.setdefault(group.protocol.id, {})[manifest.device] = figures
    return found, left_out


def _why_not(group: Group, fingerprint: str) -> str | None:
    """Return why a row says nothing of the method's data files as they are, or None."""
    if fingerprint != group.method.fingerprint:
        return "the method or its weights have changed since it ran; run it again"
    if len(group.trials) < group.planned:
        return f"{len(group.trials)} of {group.planned} trials; give the run's command again"
    return None
