"""A run again, from its manifest: the commands that carry out every trial that it has a row of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from regbench.errors import UserError
from regbench.report.rundata import Group, RunData
from regbench.runner.plan import RunConfig
from regbench.runner.rundir import RUNS, read_json


def replay(
    original: Path,
    run: RunData,
    out: Path,
    *,
    limit: int | None = None,
    data: Path | None = None,
    jobs: int | None = None,
) -> list[RunConfig]:
    """Return the configurations that run again, in one folder, what a run has rows of.

    A folder may hold several commands' rows, so that not every method ran on as many problems of every protocol: each
    set of methods and number of problems is a configuration of its own.

    Args:
        original: The run's folder.
        run: What was read from it.
        out: The new run's folder.
        limit: Only the first so many problems of each protocol.
        data: Folder of the prepared data, if not the one that the run names.
        jobs: Trials at a time, if not as many as the run had; no answer depends on it.

    Raises:
        UserError: The folders are the same, or the manifest's configuration is none that this regbench knows.
    """
    if out.resolve() == original.resolve():
        raise UserError(f"{out}: is the run itself; give another --out")
    try:
        settings = dict(read_json(original / "manifest.json")["config"])
        # Here, wherever the run was: no answer depends on it.
        changes: dict[str, Any] = {"out": str(out), "fresh": False, "executor": "local", "scheduler": None}
        changes |= {"data": str(data)} if data is not None else {}
        changes |= {"jobs": jobs} if jobs is not None else {}
        configs = [
            RunConfig.model_validate(
                {**settings, **changes, "method": list(methods), "protocol": protocols, "limit": problems}
            )
            for (methods, problems), protocols in _parts(run.groups, limit).items()
        ]
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(["config", *map(str, first["loc"])])
        words = f"{name} = {str(first['input'])[:80]!r}: {first['msg'].lower()}"
        raise UserError(f"{original / 'manifest.json'}: {words}; was it written by another regbench?") from None
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{original / 'manifest.json'}: is not a run's manifest ({error})") from None
    if not configs:
        raise UserError(f"{original}: has no row to run again")
    return configs


def default_out(original: Path) -> Path:
    """Return the folder of the new run where none is named: NAME-again under runs/, for a run of that name."""
    return RUNS / f"{original.resolve().name}-again"


def _parts(groups: Sequence[Group], limit: int | None) -> Mapping[tuple[tuple[str, ...], int], list[str]]:
    """Return the protocols by methods and number of problems: what one command each can ask for."""
    asked: dict[str, dict[int, list[str]]] = {}
    for group in groups:
        if group.trials:
            problems = 1 + max(problem for problem, _ in group.trials)
            by_count = asked.setdefault(group.protocol.id, {})
            by_count.setdefault(min(problems, limit or problems), []).append(group.method.method)
    parts: dict[tuple[tuple[str, ...], int], list[str]] = {}
    for protocol, by_count in asked.items():
        for count, methods in by_count.items():
            parts.setdefault((tuple(methods), count), []).append(protocol)
    return parts
