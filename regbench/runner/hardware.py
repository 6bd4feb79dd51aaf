"""The machine that trials run on, in words."""

from __future__ import annotations

import os
import platform
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def hardware() -> dict[str, Any]:
    """Return the machine in words."""
    import psutil

    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    return {
        "hostname": socket.gethostname(),
        "cpu": _cpu_name(),
        "cores": os.cpu_count(),
        "affinity": cores,
        "memory_gb": round(psutil.virtual_memory().total / 2**30, 1),
        "system": platform.platform(),
    }


def _cpu_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def machine_words(machine: Mapping[str, Any]) -> str:
    """Return what of a machine's `hardware` decides whether times compare: processor and number of cores."""
    return f"{machine['cpu']}, {machine['cores']} cores"
