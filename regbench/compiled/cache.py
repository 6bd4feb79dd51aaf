"""Which of numba's caches serves the processes of regbench. Nothing heavy is imported here."""

from __future__ import annotations

import os

# The two others are numba's own, for functions that come from a notebook or a zip file.
LOCATORS = "regbench.compiled.files.KernelLocator,IPythonCacheLocator,ZipCacheLocator"
# Given for the folder where none can be written.
NOWHERE = "/dev/null"


def settle() -> None:
    """Let numba keep compiled code by our rules (regbench/compiled/files.py), here and in processes started later.

    A process calls it first of all: numba reads the setting when it is imported.
    """
    os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", LOCATORS)
