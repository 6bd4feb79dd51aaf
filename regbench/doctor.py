"""What this machine offers: versions, cores, GPU, and which methods and data are ready, and why not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from regbench import inventory
from regbench.datasets.store import data_dir
from regbench.runner.manifest import hardware, versions

# Import times differ by seconds and an import may crash: each is tried in a process of its own.
_IMPORT = "from regbench.native import load_libusb; load_libusb(); import {0}; print('imports')"


def examine(data: Path | None, plugins: Sequence[Path]) -> dict[str, dict[str, str]]:
    """Return titles with names and words under them."""
    machine = hardware()
    return {
        "versions": versions(),
        "machine": {
            "cpu": machine["cpu"],
            "cores": f"{machine['cores']}, of which this process may use {len(machine['affinity'])}",
            "memory": f"{machine['memory_gb']} GB",
            "gpu": _gpu(),
            "system": machine["system"],
        },
        "packages": {module: _imports(module) for module in ("open3d", "small_gicp", "kiss_icp")},
        "methods": {
            entry["name"]: "ready" if entry["ready"] else entry["summary"] for entry in inventory.methods(plugins)
        },
        "data": {
            "folder": f"{data_dir(data)} (--data, else REGBENCH_DATA, else ./data)",
            **{
                entry["name"]: "ready" if entry["ready"] else entry["summary"]
                for entry in inventory.datasets(data) + inventory.protocols(data)
            },
        },
    }


def _gpu() -> str:
    if shutil.which("nvidia-smi") is None:
        return "none (no nvidia-smi)"
    query = ["nvidia-smi", "--query-gpu=name,memory.total,driver_version", "--format=csv,noheader"]
    try:
        answer = subprocess.run(query, capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        return f"nvidia-smi fails: {error}"
    return "; ".join(answer.stdout.split("\n")).strip("; ") or "none"


def _imports(module: str) -> str:
    command = [sys.executable, "-c", _IMPORT.format(module)]
    environment = os.environ | {"OMP_WAIT_POLICY": "passive"}
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, check=False)
    except subprocess.TimeoutExpired:
        return "import does not end within 120 s"
    if answer.returncode == 0:
        return "imports"
    lines = answer.stderr.strip().splitlines()
    return f"does not import: {lines[-1] if lines else f'exit code {answer.returncode}'}"
