"""The folder of a run: manifest.json, trials.jsonl, problems.jsonl, logs/, tables/."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.files import write_lines_atomically
from regbench.json_lines import parse_json
from regbench.runner.fingerprint import digest
from regbench.runner.journal import Journal
from regbench.runner.manifest import add_machines
from regbench.runner.plan import Plan, RunConfig

RUNS = Path("runs")


@dataclass(frozen=True)
class RunDir:
    """Paths of a run's folder."""

    path: Path

    @property
    def manifest(self) -> Path:
        """What was run, on what."""
        return self.path / "manifest.json"

    @property
    def trials(self) -> Path:
        """The journal."""
        return self.path / "trials.jsonl"

    @property
    def problems(self) -> Path:
        """The ground truth of every problem of the run."""
        return self.path / "problems.jsonl"

    @property
    def logs(self) -> Path:
        """What methods printed."""
        return self.path / "logs"

    @property
    def tables(self) -> Path:
        """Rendered tables."""
        return self.path / "tables"


def of_config(config: RunConfig) -> RunDir:
    """Return the folder of a configuration: `--out`, else one under runs/ named after what is asked.

    The name holds a hash of all that decides which trials there are, so that the same command finds its own folder.
    """
    if config.out is not None:
        return RunDir(Path(config.out))
    what = config.model_dump(include={"method", "protocol", "limit", "repeat", "seed", "threads", "device", "plugin"})
    if config.batch > 1:
        what["batch"] = config.batch
    words = "+".join(config.method) + "--" + "+".join(config.protocol)
    slug = re.sub(r"[^A-Za-z0-9_.@+=-]+", "-", words)[:60].strip("-")
    return RunDir(RUNS / f"{slug}-{digest(what)[:8]}")


def make(run: RunDir, *, fresh: bool) -> None:
    """Make the folder; with `fresh`, an older journal is set aside under a dated name, not deleted.

    Raises:
        UserError: The folder cannot be made or holds something else.
    """
    try:
        if run.path.is_dir() and _has_strangers(run):
            raise UserError(f"{run.path}: is not empty and not a run; give another --out")
        for folder in (run.path, run.logs, run.tables):
            folder.mkdir(parents=True, exist_ok=True)
        if fresh:
            _set_aside(run)
    except OSError as error:
        raise UserError(f"{run.path}: cannot be made ({error.strerror})") from error


def _has_strangers(run: RunDir) -> bool:
    """Return whether the folder holds what no run left there; one killed at its start leaves empty folders."""
    if run.trials.exists() or run.manifest.exists():
        return False
    ours = {run.logs.name, run.tables.name}
    return any(path.name not in ours and ".before-" not in path.name for path in run.path.iterdir())


def _set_aside(run: RunDir) -> None:
    with Journal(run.trials) if run.trials.exists() else nullcontext():  # refused while another run writes to it
        stamp = datetime.now().strftime("%Y%m%d-%H%M%S-%f")
        for path in (run.trials, run.manifest, run.problems):
            if path.exists():
                path.rename(path.with_name(f"{path.stem}.before-{stamp}{path.suffix}"))


def point_latest(run: RunDir) -> str | None:
    """Let runs/latest point to the run, wherever that is; return in words why it cannot be done, or None."""
    latest = RUNS / "latest"
    temporary = RUNS / f".latest.{os.getpid()}.tmp"
    try:
        RUNS.mkdir(exist_ok=True)
        temporary.symlink_to(run.path.resolve())
        temporary.replace(latest)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        return f"{latest} is left as it is ({error.strerror}); this run's table: `regbench table {run.path}`"
    return None


def merge_manifest(run: RunDir, manifest: dict[str, Any]) -> dict[str, Any]:
    """Return the manifest, with the methods and protocols added that the folder holds and this command leaves out.

    Raises:
        UserError: The folder's rows were made with another seed, number of threads or device, or its manifest is
            damaged.
    """
    if not run.manifest.exists():
        return manifest
    try:
        return _merged(run, manifest, read_json(run.manifest))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        what = f"has no {error}" if isinstance(error, KeyError) else str(error)
        raise UserError(
            f"{run.manifest}: is not a run's manifest ({what}); restore it, or set the old rows aside: "
            "`regbench run --fresh`"
        ) from error


def _merged(run: RunDir, manifest: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    for option in ("seed", "threads", "batch", "device"):
        was, now = before["config"].get(option, 1), manifest["config"][option]
        if was != now:
            raise UserError(
                f"{run.path}: holds a run with --{option} {was}, this one has --{option} {now}; "
                "give another --out, or set the old rows aside: `regbench run --fresh`"
            )
    manifest["config"]["repeat"] = max(manifest["config"]["repeat"], before["config"]["repeat"])
    ids = {protocol["id"]: protocol for protocol in manifest["protocols"]}
    for old in before["protocols"]:
        new = ids.get(old["id"])
        if new is None:
            manifest["protocols"].append(old)
        elif new["sha256"] == old["sha256"]:
            new["n"] = max(new["n"], old["n"])
    asked = {method["method"] for method in manifest["methods"]}
    manifest["methods"] += [method for method in before["methods"] if method["method"] not in asked]
    add_machines(manifest, [before["hardware"], *before.get("also_measured_on", [])])
    session = {key: before.get(key) for key in ("command", "started", "finished", "git", "regbench_version")}
    manifest["earlier"] = [*before.get("earlier", []), session]
    return manifest


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        UserError: The file cannot be read.
        ValueError: It holds something else.
    """
    try:
        value = json.loads(path.read_bytes())
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    if not isinstance(value, dict):
        raise ValueError("not a JSON object")
    return value


def write_problems(run: RunDir, plan: Plan, problems: Mapping[str, Sequence[str]]) -> None:
    """Write a line for each planned problem, after those that the folder holds of other problems.

    A damaged line is left out: where it is of a planned problem, it is written anew; else a table names what is lost.

    Args:
        run: The folder.
        plan: What is planned.
        problems: Lines without their ends, by protocol id, in the order of the problems (see `run.survey`).
    """
    counts = {planned.protocol.id: planned.count for planned in plan.protocols}
    write_lines_atomically(
        run.problems,
        chain(
            _lines_of_others(run.problems, counts),
            (f"{line}\n".encode() for protocol, count in counts.items() for line in problems[protocol][:count]),
        ),
    )


def _lines_of_others(path: Path, counts: Mapping[str, int]) -> Iterator[bytes]:
    """Yield the whole lines of a problems.jsonl that are of none of the first so many problems of a protocol."""
    if not path.exists():
        return
    with path.open("rb") as file:
        for line in file:
            try:
                row = parse_json(line)
                is_planned = 0 <= row["problem"] < counts.get(row["protocol"], 0)
            except (ValueError, KeyError, TypeError):
                continue
            if not is_planned:
                yield line if line.endswith(b"\n") else line + b"\n"


def find_run(path: Path | None) -> Path:
    """Return the folder of a run: as named, or one of that name under runs/, or the latest.

    Raises:
        UserError: There is no such run.
    """
    if path is None:
        latest = RUNS / "latest"
        if not (latest / "manifest.json").is_file():
            raise UserError("no run yet: runs/latest is missing here; start one with `regbench run --method icp`")
        return latest
    with suppress(OSError):  # too long a name
        for candidate in (path, RUNS / path):
            if (candidate / "manifest.json").is_file():
                return candidate
    raise UserError(f"{path}: is not a run (no manifest.json in it)")
