"""Cores of this machine that no other lane holds, whichever process it is in."""

from __future__ import annotations

import fcntl
import os
import tempfile
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import IO

from regbench.errors import UserError


class ClaimedCores:
    """Free ones of the cores that this process may use, claimed by locks on files; a process's end frees them.

    Args:
        count: How many at most.

    Attributes:
        cores: Their numbers, the highest first; fewer than `count` where others hold the rest.

    Raises:
        UserError: The files cannot be made.
    """

    def __init__(self, count: int) -> None:
        folder = Path(tempfile.gettempdir()) / f"regbench-cores-{os.getuid()}"
        self.cores: list[int] = []
        with ExitStack() as locks:
            try:
                folder.mkdir(exist_ok=True)
                for core in sorted(os.sched_getaffinity(0), reverse=True):
                    if len(self.cores) < count and (lock := _locked(folder / str(core))) is not None:
                        locks.enter_context(lock)
                        self.cores.append(core)
            except OSError as error:
                raise UserError(
                    f"{folder}: cores cannot be claimed for timed trials ({error.strerror}); set TMPDIR to a folder "
                    "that can be written"
                ) from error
            self._locks = locks.pop_all()

    def free(self) -> None:
        """Let others have them."""
        self._locks.close()

    def __enter__(self) -> ClaimedCores:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.free()


def _locked(path: Path) -> IO[bytes] | None:
    file = path.open("ab")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    return file
