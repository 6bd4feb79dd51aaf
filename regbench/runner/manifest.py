"""The manifest of a run: what was run, on what, with which versions."""

from __future__ import annotations

import json
import platform
import subprocess
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import regbench
from regbench.files import write_atomically
from regbench.registry import Method
from regbench.runner.hardware import hardware, machine_words
from regbench.runner.plan import Plan

PACKAGES = ("numpy", "scipy", "numba", "torch", "open3d", "small_gicp", "kiss-icp", "pandas", "h5py")


def versions() -> dict[str, str]:
    """Return the versions of Python, regbench and the packages that answers depend on."""
    found = {"python": platform.python_version(), "regbench": regbench.__version__}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def git_state() -> dict[str, Any] | None:
    """Return the commit of regbench's own checkout and whether it has changes, or None outside one."""
    folder = Path(regbench.__file__).parent
    try:
        run = [
            subprocess.run(["git", "-C", str(folder), *command], capture_output=True, text=True, check=True, timeout=10)
            for command in (["rev-parse", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
        ]
    except (OSError, subprocess.SubprocessError):
        return None
    return {"commit": run[0].stdout.strip(), "changed": bool(run[1].stdout.strip())}


def describe(plan: Plan, command: list[str]) -> dict[str, Any]:
    """Return the manifest of a plan."""
    return {
        "regbench_version": regbench.__version__,
        "command": command,
        "started": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "finished": None,
        "config": plan.config.model_dump(),
        "data_dir": str(plan.data_dir),
        "seed": plan.config.seed,
        "hardware": hardware(),
        "versions": versions(),
        "git": git_state(),
        "methods": [
            {
                "method": planned.method.asked,
                "name": planned.method.cls.__dict__.get("name", planned.method.asked),
                "kind": planned.method.trait("kind"),
                "sees_ground_truth": planned.method.trait("sees_ground_truth"),
                "batch": plan.batch_of(place),
                "deterministic": planned.method.trait("deterministic"),
                "parameters": planned.method.parameters,
                "version": str(planned.method.trait("version")),
                "fingerprint": planned.fingerprint,
                "training": _training(planned.method),
            }
            for place, planned in enumerate(plan.methods)
        ],
        "protocols": [
            {
                "id": planned.protocol.id,
                "description": planned.protocol.description,
                "dataset": planned.protocol.dataset,
                "sha256": planned.sha256,
                "data_sha256": planned.problems.data_sha256,
                "n": planned.count,
                "headline_metrics": list(planned.protocol.headline_metrics),
                "published": planned.protocol.published,
            }
            for planned in plan.protocols
        ],
    }


def _training(method: Method) -> str | None:
    """Return what a method says of its weights' training; it need not derive from Registrar."""
    words = getattr(method.cls, "training", None)
    return words(method.cls(**method.parameters)) if words else None


def add_machines(manifest: dict[str, Any], machines: Sequence[Mapping[str, Any]]) -> None:
    """Add machines to those that a manifest says trials ran on; each once."""
    known = [manifest["hardware"], *manifest.get("also_measured_on", [])]
    for machine in machines:
        if all(_which(machine) != _which(other) for other in known):
            known.append(machine)
    if len(known) > 1:
        manifest["also_measured_on"] = known[1:]


def _which(machine: Mapping[str, Any]) -> tuple[str, str]:
    return machine["hostname"], machine_words(machine)


def write(path: Path, manifest: dict[str, Any]) -> None:
    """Write a manifest, whole or not at all."""
    write_atomically(path, json.dumps(manifest, indent=1).encode() + b"\n")
