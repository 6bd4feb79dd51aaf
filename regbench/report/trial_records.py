"""Every trial of a run as a flat record, for other tools."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from regbench.report.problem_names import ProblemName, problem_names
from regbench.report.rundata import Group, RunData, read_run
from regbench.report.table import choose
from regbench.report.trial_errors import trial_errors
from regbench.runner.status import Status

Record = dict[str, Any]


def trial_records(
    run_dirs: Sequence[Path], *, protocols: Sequence[str] | None = None, methods: Sequence[str] | None = None
) -> Iterator[Record]:
    """Yield a record for each trial of each run, in the order of runs, protocols, methods, problems and repeats.

    Runs are not merged: a trial that two of them hold is there twice, `run` says of which. Stale rows are left out.
    `T_target_source` is 4x4, None where the trial failed; its errors are then those of the identity, as in tables.
    Errors are None where no truth is known, times where there is none.

    Args:
        run_dirs: Run folders.
        protocols: Only these ids; None for all.
        methods: Only these, as they were asked for; None for all.

    Raises:
        UserError: A run cannot be read, or a name is not in it.
    """
    for run_dir in run_dirs:
        run = choose(read_run(run_dir), protocols, methods)
        names = problem_names([run_dir])
        for group in run.groups:
            yield from _of_group(group, run, run_dir, names)


def _of_group(group: Group, run: RunData, run_dir: Path, names: dict[tuple[str, int], ProblemName]) -> Iterator[Record]:
    truths = run.truths[group.protocol.id, group.protocol.sha256]
    errors = trial_errors(group, run)
    of_known = iter(zip(errors.rotation_errors_deg.tolist(), errors.translation_errors.tolist(), strict=True))
    for (problem, repeat), trial in group.trials.items():
        rotation_error_deg, translation_error = (None, None) if truths[problem] is None else next(of_known)
        name = names.get((group.protocol.id, problem), ProblemName())
        yield {
            "run": str(run_dir),
            "protocol": group.protocol.id,
            "protocol_sha256": group.protocol.sha256,
            "method": group.method.method,
            "fingerprint": group.method.fingerprint,
            "settings": group.method.settings,
            "hardware": trial.machine,
            "problem": problem,
            "problem_id": name.id,
            "category": name.label,
            "repeat": repeat,
            "status": trial.status.value,
            "rotation_error_deg": rotation_error_deg,
            "translation_error": translation_error,
            "time_ms": _number(trial.time_ms),
            "cpu_ms": _number(trial.cpu_ms),
            "key": trial.key,
            "T_target_source": trial.T_target_source if trial.status is Status.OK else None,
        }


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
