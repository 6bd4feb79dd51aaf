"""What tables are made of: the trials of one or several run folders, one row each, against their ground truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from regbench.errors import UserError
from regbench.report.manifest import Manifest, MethodInfo, ProtocolInfo, read_manifest
from regbench.report.trials import NotATrialError, Trials, TrialsBuilder
from regbench.report.truths import Truths, no_truths, read_truths
from regbench.runner.journal import rows_in


@dataclass(frozen=True, eq=False)
class Group:
    """The trials of one method on one protocol, in the order of problem and repeat.

    Attributes:
        method: The method.
        protocol: The protocol.
        repeat: How many times each problem was to be run.
        trials: By (problem, repeat).
        run_dirs: The folders they came from.
    """

    method: MethodInfo
    protocol: ProtocolInfo
    repeat: int
    trials: Trials
    run_dirs: tuple[Path, ...]

    @property
    def planned(self) -> int:
        """Number of trials that the run planned."""
        return self.protocol.n * self.repeat


@dataclass(frozen=True, eq=False)
class RunData:
    """One or several runs, ready to be summarised.

    Attributes:
        groups: Sections in the order of the protocols, rows in the order of the methods, as they were asked for.
        truths: Ground truth T_target_source by (protocol id, sha256) and problem; None where nobody knows it.
        stale: Rows left out because their method or protocol has changed since, or is not in the manifest.
        machines: Those that times are of, in words.
        times_left_out: Trials whose times are left out, by machine (see one_machine.py).
    """

    groups: Sequence[Group]
    truths: Mapping[tuple[str, str], Truths]
    stale: int
    machines: Sequence[str]
    times_left_out: Mapping[str, int] = field(default_factory=dict)


def read_run(run_dir: Path) -> RunData:
    """Read one run folder. Of several rows of one trial the last wins.

    Raises:
        UserError: A file is missing, damaged or not a run's.
    """
    manifest = read_manifest(run_dir)
    truths = read_truths(run_dir / "problems.jsonl")
    trials, stale = _read_trials(run_dir / "trials.jsonl", manifest)
    groups = [
        Group(method, protocol, manifest.repeat, trials[method.method, protocol.id], (run_dir,))
        for protocol in manifest.protocols.values()
        for method in manifest.methods.values()
    ]
    for group in groups:
        lacking = truths.get(group.protocol.id, no_truths()).lacking(group.trials.problems)
        if lacking is not None:
            raise UserError(
                f"{run_dir / 'problems.jsonl'}: has no problem {lacking} of {group.protocol.id}, which "
                "trials.jsonl answers; the file was damaged or belongs to another run. Give the run's command again"
            )
    groups = [_with_machines(group, manifest) for group in groups]
    named = dict.fromkeys(machine for group in groups for machine in dict.fromkeys(group.trials.machines.tolist()))
    by_hash = {(info.id, info.sha256): truths.get(info.id, no_truths()) for info in manifest.protocols.values()}
    return RunData(groups, by_hash, stale, list(named) or manifest.machines)


def _with_machines(group: Group, manifest: Manifest) -> Group:
    """Name the machine of rows from before rows named theirs: the manifest's, or all that it has."""
    machines = group.trials.machines
    unnamed = "; ".join(manifest.machines)
    return replace(group, trials=replace(group.trials, machines=np.where(machines == "", unnamed, machines)))


def _read_trials(path: Path, manifest: Manifest) -> tuple[dict[tuple[str, str], Trials], int]:
    """Return the trials of the manifest's methods and protocols, and the number of stale rows left out."""
    builders = {(method, protocol): TrialsBuilder() for method in manifest.methods for protocol in manifest.protocols}
    stale = 0
    for number, row in enumerate(rows_in(path), start=1):
        try:
            builder = builders.get((row["method"], row["protocol"]))
            fresh = (
                builder is not None
                and row["fingerprint"] == manifest.methods[row["method"]].fingerprint
                and row["protocol_sha256"] == manifest.protocols[row["protocol"]].sha256
            )
            if builder is None or not fresh:
                stale += 1
                continue
            builder.add(row, number)
        except (KeyError, TypeError, ValueError, OverflowError) as error:  # JSON's whole numbers have no end
            raise _not_a_trial(path, number, f"has no {error}" if isinstance(error, KeyError) else str(error)) from None
    try:
        return {key: builder.build() for key, builder in builders.items()}, stale
    except NotATrialError as error:
        raise _not_a_trial(path, *error.args) from None


def _not_a_trial(path: Path, line: int, why: str) -> UserError:
    return UserError(f"{path}: line {line} is not a trial ({why}); the file was damaged")
