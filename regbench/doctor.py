"""What this machine offers: versions, cores, GPU, and which methods and data are ready, and why not."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from regbench import inventory
from regbench.compiled.cache import NOWHERE
from regbench.datasets.store import data_dir
from regbench.runner.hardware import hardware
from regbench.runner.manifest import versions

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
        "compiled code": _compiled_code(),
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
    try:
        _python("-c", _IMPORT.format(module))
    except ChildProcessError as error:
        return f"does not import: {error}"
    return "imports"


def _compiled_code() -> dict[str, str]:
    """Return where it is kept between processes, and what a new process waits for its first answer."""
    try:
        found = json.loads(_python("-m", "regbench.compiled.start"))
    except ChildProcessError as error:
        return {"our ICP": f"does not start: {error}"}
    kept = found["folder"] != NOWHERE
    if not found["compiled"]:
        how = "loaded"
    elif kept:
        how = "compiled, and kept for the next process"
    else:
        how = "compiled, as in every process"
    return {
        "kept in": f"{found['folder']} (writable)" if kept else "no folder can be written (NUMBA_CACHE_DIR names one)",
        "our ICP": f"{how}: import {found['import_s']:.1f} s, first answer {found['first_answer_s']:.1f} s",
    }


def _python(*arguments: str) -> str:
    """Return what a Python process of its own prints.

    Raises:
        ChildProcessError: It failed; why.
    """
    environment = os.environ | {"OMP_WAIT_POLICY": "passive"}
    try:
        answer = subprocess.run(
            [sys.executable, *arguments], capture_output=True, text=True, timeout=120, env=environment, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise ChildProcessError("no end within 120 s") from error
    if answer.returncode != 0:
        lines = answer.stderr.strip().splitlines()
        raise ChildProcessError(lines[-1] if lines else f"exit code {answer.returncode}")
    return answer.stdout
