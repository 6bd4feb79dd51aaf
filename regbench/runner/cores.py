"""Cores of this machine that no other lane holds, whichever process it is in."""

from __future__ import annotations

import fcntl
import os
import socket
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import IO

from regbench.errors import UserError


class ClaimedCores:
    """So many of the cores that this process may use, claimed by locks on files; a process's end frees them.

    Args:
        count: How many.

    Attributes:
        cores: Their numbers.

    Raises:
        UserError: So many are not free.
    """

    def __init__(self, count: int) -> None:
        folder = Path(tempfile.gettempdir()) / f"regbench-cores-{os.getuid()}"
        folder.mkdir(exist_ok=True)
        self.cores: list[int] = []
        usable = sorted(os.sched_getaffinity(0), reverse=True)
        with ExitStack() as locks:
            for core in usable:
                if len(self.cores) < count and (lock := _locked(folder / str(core))) is not None:
                    locks.enter_context(lock)
                    self.cores.append(core)
            if len(self.cores) < count:
                raise UserError(
                    f"{socket.gethostname()}: a dask worker's thread needs {count} cores for itself, of the "
                    f"{len(usable)} that it may use {len(self.cores)} are free: timed trials never share a core. "
                    "Start workers with --nthreads 1, and fewer of them"
                )
            self._locks = locks.pop_all()

    def free(self) -> None:
        """Let others have them."""
        self._locks.close()


def _locked(path: Path) -> IO[bytes] | None:
    file = path.open("ab")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        return None
    return file
