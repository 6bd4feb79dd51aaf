"""The seam between a plan and who carries it out."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from regbench.errors import UserError
from regbench.runner.plan import Plan, RunConfig
from regbench.suggest import unknown

Row = dict[str, Any]

EXECUTORS = {
    "local": "regbench.runner.local:LocalExecutor",
    "dask": "regbench.runner.dask_executor:DaskExecutor",
}


class Executor(Protocol):
    """Carries out the trials of a plan. A trial is the same whoever executes it."""

    def check(self, config: RunConfig) -> None:
        """Raise UserError if it cannot carry out a run so configured here; asked before anything is written."""

    def execute(
        self, plan: Plan, done: set[str], logs: Path, on_row: Callable[[Row], None], note: Callable[[str], None]
    ) -> Sequence[Mapping[str, Any]]:
        """Run every trial whose key is not in `done`, and hand over each row as it comes, from one thread at a time.

        `note` takes what the user should know meanwhile.

        Returns the machines that trials ran on, as `hardware` describes one, where it may be others than this one.

        An exception that `on_row` raises (a full disk, an interrupt) ends the run: workers are killed and it is raised.
        """


def find_executor(name: str) -> Executor:
    """Return an executor by name.

    Raises:
        UserError: Unknown name.
    """
    if name not in EXECUTORS:
        raise UserError(unknown("executor", name, EXECUTORS))
    module, attribute = EXECUTORS[name].split(":")
    executor: Executor = getattr(importlib.import_module(module), attribute)()
    return executor
