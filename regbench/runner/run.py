"""A run from configuration to rows: reads like a table of contents."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from regbench.datasets.store import data_dir
from regbench.errors import UserError
from regbench.protocols.protocol import ProblemSet
from regbench.registry import MethodRegistry, find_protocol, parse_methods, split_names
from regbench.runner import manifest, rundir
from regbench.runner.executor import find_executor
from regbench.runner.journal import Journal, Row, rows_in
from regbench.runner.plan import Plan, PlannedProtocol, RunConfig, plan_method
from regbench.runner.rundir import RunDir
from regbench.runner.status import Status


@dataclass
class Tally:
    """Trials of one method: all, and those that have a row."""

    total: int = 0
    done: int = 0


class Progress(Protocol):
    """What a run tells of itself while it goes on."""

    def start(self, run: RunDir, trials: Mapping[str, Tally]) -> None:
        """How many trials each method has, and how many of them have a row already."""

    def row(self, row: Row) -> None:
        """One more trial."""

    def note(self, message: str) -> None:
        """Something the user should know."""


def run(config: RunConfig, *, command: Sequence[str], progress: Progress) -> RunDir:
    """Carry out a run, continuing where an earlier one of the same folder stopped.

    Raises:
        UserError: Bad input, or the disk is full. Finished trials are in the journal.
    """
    executor = find_executor(config.executor)
    plan, problems = make_plan(config)
    executor.check(config)
    run_dir = rundir.of_config(config)
    rundir.make(run_dir, fresh=config.fresh)
    with Journal(run_dir.trials) as journal:
        if journal.torn_bytes:
            progress.note(
                f"{run_dir.trials}: a torn last line of {journal.torn_bytes} bytes was cut; its trial runs again"
            )
        done = done_keys(run_dir.trials, config)
        description = rundir.merge_manifest(run_dir, manifest.describe(plan, list(command)))
        rundir.write_problems(run_dir, plan, problems)
        manifest.write(run_dir.manifest, description)
        if words := rundir.point_latest(run_dir):
            progress.note(words)
        progress.start(run_dir, _tallies(plan, done))
        machines = executor.execute(plan, done, run_dir.logs, _recorder(journal, progress), progress.note)
        manifest.add_machines(description, machines)
        description["finished"] = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        manifest.write(run_dir.manifest, description)
    return run_dir


def done_keys(trials: Path, config: RunConfig) -> set[str]:
    """Return the keys of the journal's trials that need not run again."""
    return {row["key"] for row in rows_in(trials) if _stands(row, config)}


def _stands(row: Row, config: RunConfig) -> bool:
    """Whether a trial with this row need not run again: what was missing does, and what ran out of less than now."""
    match row.get("status"):
        case Status.MISSING:
            return False
        case Status.TIMEOUT:
            return bool(row.get("timeout_s", config.timeout) >= config.timeout)
        case Status.OOM:
            return bool(row.get("memory_gb", config.memory) >= config.memory)
    return True


def _tallies(plan: Plan, done: set[str]) -> dict[str, Tally]:
    total = plan.config.repeat * sum(planned.count for planned in plan.protocols)
    tallies = {planned.method.asked: Tally(total) for planned in plan.methods}
    if done:  # else a large run would go through all of its trials' keys for nothing
        for block in plan.blocks(set()):
            tally = tallies[plan.methods[block[0].method].method.asked]
            tally.done += sum(trial.key in done for trial in block)
    return tallies


def _recorder(journal: Journal, progress: Progress) -> Callable[[Row], None]:
    def record(row: Row) -> None:
        journal.append(row)
        progress.row(row)

    return record


def make_plan(config: RunConfig) -> tuple[Plan, dict[str, list[str]]]:
    """Resolve every name of a configuration; return the plan and, by protocol, what `survey` says of each problem.

    Raises:
        UserError: An unknown name, a bad parameter, a dataset that is not prepared, a device that is not there.
    """
    _check_device(config.device)
    registry = MethodRegistry([Path(path) for path in config.plugin])
    methods = [plan_method(registry.resolve(spec)) for spec in parse_methods(config.method)]
    folder = data_dir(Path(config.data) if config.data else None)
    protocols, lines = [], {}
    for text in split_names(config.protocol) or []:
        protocol = find_protocol(text)
        if protocol.id in lines:
            raise UserError(f"protocol '{protocol.id}' is asked for twice")
        problems = protocol.open(folder)
        sha256, lines[protocol.id] = survey(protocol.id, problems)
        count = min(len(problems), config.limit or len(problems))
        protocols.append(PlannedProtocol(protocol, problems, sha256, count))
    return Plan(config, methods, protocols, folder.resolve()), lines


def survey(protocol_id: str, problems: ProblemSet) -> tuple[str, list[str]]:
    """Go once through all problems; return the SHA-256 that freezes them, and a line of problems.jsonl for each.

    A line is JSON with the problem's answer, label and id; as text, for as objects it would take five times the memory.
    """
    digest = hashlib.sha256(f"{protocol_id} {len(problems)}".encode())
    lines = []
    for index, pair in enumerate(problems):
        for array in (pair.source, pair.target, pair.T_target_source):
            digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        truth = None if pair.T_target_source is None else pair.T_target_source.tolist()
        answer = {"T_target_source": truth, "label": pair.label, "id": pair.id}
        lines.append(json.dumps({"protocol": protocol_id, "problem": index, **answer}, separators=(",", ":")))
    return digest.hexdigest(), lines


def _check_device(device: str) -> None:
    if device == "cpu":
        return
    try:
        import torch
    except ImportError:
        raise UserError(f"--device {device}: torch is not installed") from None
    if not torch.cuda.is_available():
        raise UserError(f"--device {device}: torch {torch.__version__} finds no CUDA device on this machine")
