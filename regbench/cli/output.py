"""What a command writes where its --out says."""

from __future__ import annotations

from pathlib import Path

from regbench.errors import UserError
from regbench.files import write_atomically


def write_output(out: Path, content: bytes) -> None:
    """Write a file that the user named; a run's own are not written over.

    Raises:
        UserError: It is one of a run's own, or cannot be written.
    """
    from regbench.runner.rundir import RunDir

    target = out.resolve()
    run = RunDir(target.parent)
    if target in (run.manifest, run.trials, run.problems) and target.exists():
        raise UserError(f"--out {out}: is a run's own file, which nothing could bring back; name another")
    write_atomically(out, content)
