"""Several runs as one: refused where rows would not compare."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from regbench.errors import UserError
from regbench.report.one_machine import times_of_one_machine
from regbench.report.rundata import Group, RunData, read_run
from regbench.report.truths import Truths


def read_runs(run_dirs: Sequence[Path], *, mixed: bool = False) -> RunData:
    """Read several run folders into one; where two hold the same trial, the later folder's wins.

    Args:
        run_dirs: At least one.
        mixed: Let stand side by side what does not compare: times of different machines, protocols of one name but
            different content or version, methods of one name but different fingerprint or, on one protocol, other
            seed, threads or device. Names that would then be the same get a part of their hash, or their settings.

    Raises:
        UserError: As read_run; the runs do not compare and `mixed` is not set; or one's ground truth is not another's.
    """
    if not run_dirs:
        raise UserError("no run given; `regbench table RUN...`")
    runs = [read_run(path) for path in run_dirs]
    groups = [group for run in runs for group in run.groups]
    if not mixed:
        _refuse_mixture(groups)
    truths: dict[tuple[str, str], Truths] = {}
    for path, run in zip(run_dirs, runs, strict=True):
        for protocol, known in run.truths.items():
            if protocol not in truths:
                truths[protocol] = known
                continue
            if (problem := truths[protocol].differing(known)) is not None:
                raise UserError(
                    f"{path / 'problems.jsonl'}: problem {problem} of {protocol[0]} has another T_target_source than "
                    "in the folders before it, under one hash of the protocol: one was damaged. Give its run's command "
                    "again"
                )
            truths[protocol] = truths[protocol].joined(known)
    together = RunData(
        _named_apart(_merged(groups)),
        truths,
        sum(run.stale for run in runs),
        list(dict.fromkeys(machine for run in runs for machine in run.machines)),
    )
    return together if mixed else times_of_one_machine(together)


def _refuse_mixture(groups: Sequence[Group]) -> None:
    _refuse("protocol", groups, lambda g: g.protocol.name, lambda g: g.protocol.id)
    _refuse("protocol", groups, lambda g: g.protocol.id, lambda g: f"content {g.protocol.sha256[:8]}")
    _refuse("method", groups, lambda g: g.method.method, lambda g: f"fingerprint {g.method.fingerprint[:8]}")
    _refuse("method", groups, lambda g: f"{g.method.method} on {g.protocol.id}", lambda g: g.method.settings)


def _refuse(what: str, groups: Sequence[Group], name: Callable[[Group], str], identity: Callable[[Group], str]) -> None:
    """Raise if two groups of one name differ in what they are."""
    seen: dict[str, Group] = {}
    for group in groups:
        first = seen.setdefault(name(group), group)
        if identity(first) != identity(group):
            places = f"{identity(first)} in {first.run_dirs[0]} and {identity(group)} in {group.run_dirs[0]}"
            raise UserError(
                f"{what} '{name(group)}' is {places}: their rows do not compare; "
                "leave one out, or give --mixed to print them side by side"
            )


def _merged(groups: Sequence[Group]) -> list[Group]:
    """Join the groups of one method on one protocol; count every row against the most problems of its protocol."""
    joined: dict[tuple[str, ...], Group] = {}
    most: dict[tuple[str, str], int] = {}
    for group in groups:
        content = (group.protocol.id, group.protocol.sha256)
        most[content] = max(most.get(content, 0), group.protocol.n)
        key = (*content, group.method.method, group.method.fingerprint, group.method.settings)
        joined[key] = _joined(joined[key], group) if key in joined else group
    return [
        replace(group, protocol=replace(group.protocol, n=most[group.protocol.id, group.protocol.sha256]))
        for group in joined.values()
    ]


def _joined(first: Group, second: Group) -> Group:
    return replace(
        second,
        repeat=max(first.repeat, second.repeat),
        trials=first.trials.joined(second.trials),
        run_dirs=(*first.run_dirs, *second.run_dirs),
    )


def _named_apart(groups: Sequence[Group]) -> list[Group]:
    """Add a part of the hash, or the settings, to protocols and methods that stand for more than one thing."""
    hashes: dict[str, set[str]] = {}
    settings: dict[str, set[str]] = {}
    for group in groups:
        hashes.setdefault(group.protocol.id, set()).add(group.protocol.sha256)
        hashes.setdefault(group.method.method, set()).add(group.method.fingerprint)
        settings.setdefault(f"{group.method.method} on {group.protocol.id}", set()).add(group.method.settings)
    named = []
    for group in groups:
        protocol, method = group.protocol, group.method
        if len(hashes[protocol.id]) > 1:
            protocol = replace(protocol, label=f"{protocol.id}#{protocol.sha256[:8]}")
        if len(hashes[method.method]) > 1:
            method = replace(method, method=f"{method.method}#{method.fingerprint[:8]}")
        if len(settings[f"{group.method.method} on {protocol.id}"]) > 1:
            method = replace(method, method=f"{method.method} ({method.settings})")
        named.append(replace(group, protocol=protocol, method=method))
    return named
