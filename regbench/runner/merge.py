"""Several run folders as one: shards of a run, or of several machines, in one journal."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.runner import manifest as manifests
from regbench.runner.hardware import machine_words
from regbench.runner.journal import Journal, Row, rows_in
from regbench.runner.rundir import RunDir, read_json

Manifest = dict[str, Any]

# What a run's rows depend on beside method and protocol; a folder has one of each.
SETTINGS = ("seed", "threads", "batch", "device")
# What a merged manifest tells of each run that went into it.
TOLD = ("command", "started", "finished", "git", "regbench_version", "versions", "hardware", "config", "earlier")


def merge_runs(folders: Sequence[Path], out: Path, *, anyway: bool = False) -> tuple[int, int]:
    """Write one run folder with the trials of several; `out` is there in full or not at all.

    A trial that several hold is kept once. Rows of methods or protocols that have changed since are left behind.

    Args:
        folders: At least one.
        out: Folder to make.
        anyway: Where two folders have different answers to one trial, take the later folder's.

    Returns:
        Number of trials written, and of rows left behind as out of date.

    Raises:
        UserError: The runs do not go together (another seed, threads, device; a method or protocol that has changed),
            their answers to a trial differ, a folder is damaged, or `out` exists or cannot be written.
    """
    try:
        if out.exists():
            raise UserError(f"{out}: exists already; name another --out, or move it away")
    except OSError as error:
        raise UserError(f"{out}: cannot be made ({error.strerror})") from error
    described = [(folder, _manifest(folder)) for folder in folders]
    try:
        merged = _merged(described)
        rows, stale = _rows(described, anyway=anyway)
        problems = _problems(described)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise UserError(f"{', '.join(map(str, folders))}: one is not a run ({error!r}); is a file damaged?") from error
    run = RunDir(out.with_name(f".{out.name}.partial"))
    shutil.rmtree(run.path, ignore_errors=True)
    try:
        for folder in (run.path, run.logs, run.tables):
            folder.mkdir(parents=True)
        with Journal(run.trials) as journal:
            for row in rows:
                journal.append(row)
        write_atomically(run.problems, "".join(f"{line}\n" for line in problems).encode())
        manifests.write(run.manifest, merged)
        run.path.rename(out)
    except OSError as error:
        raise UserError(f"{out}: cannot be written ({error.strerror})") from error
    finally:
        shutil.rmtree(run.path, ignore_errors=True)
    return len(rows), stale


def _manifest(folder: Path) -> Manifest:
    path = RunDir(folder).manifest
    try:
        return read_json(path)
    except ValueError as error:
        raise UserError(f"{path}: is not a run's manifest ({error}); the file was damaged") from error


def _merged(described: Sequence[tuple[Path, Manifest]]) -> Manifest:
    """Return the first manifest with the others' methods, protocols, repeats and machines.

    Raises:
        UserError: They do not go together.
    """
    (first, base), *others = described
    merged: Manifest = json.loads(json.dumps(base))
    methods = {method["method"]: method for method in merged["methods"]}
    protocols = {protocol["id"]: protocol for protocol in merged["protocols"]}
    for folder, manifest in others:
        for option in SETTINGS:
            was, now = (config.get(option, 1) for config in (base["config"], manifest["config"]))
            if was != now:
                raise _apart(f"--{option}", f"{was} in {first}", f"{now} in {folder}")
        for method in manifest["methods"]:
            known = methods.setdefault(method["method"], method)
            if known["fingerprint"] != method["fingerprint"]:
                raise _apart(f"method {method['method']}", f"another in {folder}", "in a folder before it")
        for protocol in manifest["protocols"]:
            known = protocols.setdefault(protocol["id"], dict(protocol))
            if known["sha256"] != protocol["sha256"]:
                raise _apart(f"protocol {protocol['id']}", f"other problems in {folder}", "in a folder before it")
            known["n"] = max(known["n"], protocol["n"])
        merged["config"]["repeat"] = max(merged["config"]["repeat"], manifest["config"]["repeat"])
    merged["methods"], merged["protocols"] = list(methods.values()), list(protocols.values())
    machines = [hardware for _, manifest in described for hardware in _machines(manifest)]
    merged["also_measured_on"] = [machine for place, machine in enumerate(machines) if machine not in machines[:place]][
        1:
    ]
    merged["merged_from"] = [
        {"folder": str(folder), **{key: manifest.get(key) for key in TOLD}} for folder, manifest in described
    ]
    return merged


def _machines(manifest: Manifest) -> list[Mapping[str, Any]]:
    return [manifest["hardware"], *manifest.get("also_measured_on", [])]


def _apart(what: str, one: str, other: str) -> UserError:
    return UserError(
        f"{what}: {one}, {other}: a run folder has one of each; leave one out, or put both in a table "
        "with `regbench table A B --mixed`"
    )


def _rows(described: Sequence[tuple[Path, Manifest]], *, anyway: bool) -> tuple[list[Row], int]:
    """Return the rows by first occurrence of their key, and the number of those that are out of date."""
    rows: dict[str, tuple[Path, Row]] = {}
    stale = 0
    for folder, manifest in described:
        fingerprints = {method["method"]: method["fingerprint"] for method in manifest["methods"]}
        hashes = {protocol["id"]: protocol["sha256"] for protocol in manifest["protocols"]}
        machines = [machine_words(machine) for machine in _machines(manifest)]
        of_folder: dict[str, Row] = {}
        for row in rows_in(RunDir(folder).trials):
            if row["fingerprint"] != fingerprints.get(row["method"]) or row["protocol_sha256"] != hashes.get(
                row["protocol"]
            ):
                stale += 1
                continue
            if len(machines) == 1:
                row.setdefault("machine", machines[0])  # journals did not always say
            of_folder[row["key"]] = row  # of several the last is the trial's
        for key, row in of_folder.items():
            known = rows.get(key)
            if known is None:
                rows[key] = (folder, row)
            elif _answer(known[1]) != _answer(row):
                if not anyway:
                    where = f"{row['method']} on problem {row['problem']} of {row['protocol']}, repeat {row['repeat']}"
                    raise UserError(
                        f"{where}: {known[0]} and {folder} have different answers; leave one out, or give --anyway "
                        "to take the later folder's"
                    )
                rows[key] = (folder, row)
    return [row for _, row in rows.values()], stale


def _answer(row: Row) -> tuple[Any, Any]:
    """Return what two runs of one trial must have alike; times differ by nature."""
    return row["status"], row["T_target_source"]


def _problems(described: Sequence[tuple[Path, Manifest]]) -> list[str]:
    """Return the lines of all problems, each once.

    Raises:
        UserError: A line is no problem, or folders differ in a problem's truth.
    """
    lines: dict[tuple[str, int], tuple[Any, str]] = {}
    for folder, _ in described:
        path = RunDir(folder).problems
        try:
            text = path.read_bytes().splitlines()
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror})") from error
        for number, line in enumerate(text, start=1):
            try:
                row = json.loads(line)
                truth = row["T_target_source"]
                known = lines.setdefault((row["protocol"], row["problem"]), (truth, line.decode()))
            except (ValueError, KeyError, TypeError) as error:
                raise UserError(f"{path}: line {number} is not a problem; the file was damaged") from error
            if known[0] != truth:
                raise UserError(
                    f"{path}: line {number} has another T_target_source than the folders before it; one of them was "
                    "damaged. Give its run's command again"
                )
    return [line for _, line in lines.values()]
