"""The folder of a run: manifest.json, trials.jsonl, problems.jsonl, logs/, tables/."""

from __future__ import annotations

import json
import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.runner.fingerprint import digest
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
    words = "+".join(config.method) + "--" + "+".join(config.protocol)
    slug = re.sub(r"[^A-Za-z0-9_.@+=-]+", "-", words)[:60].strip("-")
    return RunDir(RUNS / f"{slug}-{digest(what)[:8]}")


def make(run: RunDir, *, fresh: bool) -> None:
    """Make the folder; with `fresh`, an older journal is set aside under a dated name, not deleted.

    Raises:
        UserError: The folder cannot be made or holds something else.
    """
    if run.path.is_dir() and any(run.path.iterdir()) and not run.trials.exists() and not run.manifest.exists():
        raise UserError(f"{run.path}: is not empty and not a run; give another --out")
    try:
        for folder in (run.path, run.logs, run.tables):
            folder.mkdir(parents=True, exist_ok=True)
        if fresh:
            stamp = time.strftime("%Y%m%d-%H%M%S")
            for path in (run.trials, run.manifest, run.problems):
                if path.exists():
                    path.rename(path.with_name(f"{path.stem}.before-{stamp}{path.suffix}"))
    except OSError as error:
        raise UserError(f"{run.path}: cannot be made ({error.strerror})") from error


def point_latest(run: RunDir) -> None:
    """Let runs/latest point to the run, if the run lies under runs/ or nothing is there yet."""
    RUNS.mkdir(exist_ok=True)
    latest = RUNS / "latest"
    temporary = RUNS / ".latest.tmp"
    temporary.unlink(missing_ok=True)
    temporary.symlink_to(run.path.resolve())
    temporary.replace(latest)


def merge_manifest(run: RunDir, manifest: dict[str, Any]) -> dict[str, Any]:
    """Return the manifest, with the methods and protocols added that the folder holds and this command leaves out.

    Raises:
        UserError: The folder's rows were made with another seed, number of threads or device.
    """
    if not run.manifest.exists():
        return manifest
    before = read_json(run.manifest)
    for option in ("seed", "threads", "device"):
        was, now = before["config"].get(option), manifest["config"][option]
        if was != now:
            raise UserError(
                f"{run.path}: holds a run with --{option} {was}, this one has --{option} {now}; "
                "give another --out, or --fresh to set the old rows aside"
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
    session = {key: before.get(key) for key in ("command", "started", "finished", "git", "regbench_version")}
    manifest["earlier"] = [*before.get("earlier", []), session]
    return manifest


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        UserError: The file is missing or holds something else.
    """
    try:
        value = json.loads(path.read_bytes())
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise UserError(f"{path}: is not JSON ({error})") from error
    if not isinstance(value, dict):
        raise UserError(f"{path}: is not a JSON object")
    return value


def write_problems(run: RunDir, plan: Plan, truths: dict[str, list[dict[str, Any]]]) -> None:
    """Write the ground truth of the planned problems, keeping those of protocols that the folder already holds."""
    lines: dict[tuple[str, int], str] = {}
    if run.problems.exists():
        for line in run.problems.read_text().splitlines():
            row = json.loads(line)
            lines[row["protocol"], row["problem"]] = line
    for planned in plan.protocols:
        for row in truths[planned.protocol.id][: planned.count]:
            lines[row["protocol"], row["problem"]] = json.dumps(row, separators=(",", ":"))
    write_atomically(run.problems, "".join(f"{line}\n" for line in lines.values()).encode())


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
    for candidate in (path, RUNS / path):
        if (candidate / "manifest.json").is_file():
            return candidate
    raise UserError(f"{path}: is not a run (no manifest.json in it)")
