"""A soak: methods that crash, hang and leak, beside sound ones, for an hour; figures to docs/reliability.md.

    python benchmarks/soak.py --minutes 60 --out soak.json

One process carries out run after run (`regbench.runner.run`), each with all of soak_methods.py under a limit of 2 GB
and 2 s a trial. Another looks at it every two seconds: its memory, threads and open files, and processes that are dead
but not waited for. After each run its journal is held against what had to happen: a row for every trial, none twice,
and the status that the trial's seed says. At the end no process that a run started may be alive. Exit code 1 if any of
it does not hold.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import uuid
from collections import Counter
from pathlib import Path

import numpy as np
import psutil
from soak_methods import fault_of

from regbench.registry import find_protocol
from regbench.runner.plan import RunConfig
from regbench.runner.run import run

METHODS = ["unreliable", "leaks", "icp", "identity"]
LIMIT, REPEAT = 25, 6  # 150 calls of 16 MB: the leak meets the limit once a run
TIMEOUT_S, MEMORY_GB = 2.0, 2.0
SAMPLE_S = 2.0
TOKEN = "REGBENCH_SOAK"
# Imports, numba's compiled code and the allocator's pools come with the first runs.
SETTLING_S = 120.0


class Quiet:
    """Progress that says nothing."""

    def start(self, run, trials):
        pass

    def row(self, row):
        pass

    def note(self, message):
        pass


def soak(folder: Path, stop_at: float) -> None:
    """Do run after run until it is time to stop, and write a line on each: what was found wrong, and statuses."""
    problems = find_protocol("demo@1").open(Path())
    with (folder / "runs.jsonl").open("a", buffering=1) as log:
        number = 0
        while time.time() < stop_at:
            out = folder / f"run-{number}"
            config = RunConfig(
                method=METHODS,
                protocol=["demo@1"],
                limit=LIMIT,
                repeat=REPEAT,
                seed=number,
                timeout=TIMEOUT_S,
                memory=MEMORY_GB,
                plugin=[str(Path(__file__).with_name("soak_methods.py"))],
                out=str(out),
            )
            run(config, command=["soak"], progress=Quiet())
            rows = [json.loads(line) for line in (out / "trials.jsonl").read_text().splitlines()]
            wrong = what_is_wrong(rows, problems, seed=number)
            counts = Counter(f"{row['method']} {row['status']}" for row in rows)
            log.write(json.dumps({"run": number, "rows": len(rows), "wrong": wrong, "statuses": counts}) + "\n")
            if not wrong:
                shutil.rmtree(out)
            number += 1


def what_is_wrong(rows, problems, seed: int) -> list[str]:
    """Hold rows against the trials that were asked for and the faults that their seeds say."""
    found = Counter((row["method"], row["problem"], row["repeat"]) for row in rows)
    planned = {(method, k, repeat) for method in METHODS for k in range(LIMIT) for repeat in range(REPEAT)}
    wrong = [f"lost: {trial}" for trial in sorted(planned - found.keys())]
    wrong += [f"twice: {trial}" for trial, times in found.items() if times > 1]
    wrong += [f"not asked for: {trial}" for trial in sorted(found.keys() - planned)]
    for row in rows:
        allowed = {"ok"}
        if row["method"] == "leaks":
            allowed = {"ok", "oom"}
        if row["method"] == "unreliable":
            problem, _ = problems.problem(row["problem"], protocol="demo@1", seed=seed, repeat=row["repeat"])
            kind = fault_of(problem.seed).partition("_")[0]
            allowed = {{"": "ok", "crash": "crashed", "hang": "timeout"}[kind]}
        if row["status"] not in allowed:
            where = f"{row['method']} problem {row['problem']} repeat {row['repeat']}"
            wrong.append(f"{where}: {row['status']} ({row['error']}), expected {' or '.join(sorted(allowed))}")
    if not any(row["status"] == "oom" for row in rows):
        wrong.append("the leak never met the memory limit")
    return wrong


def watch(child: subprocess.Popen, start: float) -> tuple[list[dict], list[str]]:
    """Sample the process until it ends; return the samples, and zombies that stayed for two samples or more."""
    process = psutil.Process(child.pid)
    samples, lasting, before = [], [], set()
    while child.poll() is None:
        try:
            zombies = {
                (each.pid, each.create_time())
                for each in process.children(recursive=True)
                if each.status() == psutil.STATUS_ZOMBIE
            }
            samples.append(
                {
                    "at_s": round(time.time() - start, 1),
                    "rss_mb": process.memory_info().rss / 2**20,
                    "threads": process.num_threads(),
                    "files": process.num_fds(),
                    "processes": len(process.children(recursive=True)),
                }
            )
        except psutil.NoSuchProcess:
            continue  # one of them ended while it was looked at
        lasting += [f"process {pid}" for pid, _ in zombies & before]
        before = zombies
        time.sleep(SAMPLE_S)
    return samples, lasting


def alive_with(token: str) -> list[str]:
    """Return the processes that were started with the token in their environment: what a run should have killed."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get(TOKEN) == token and process.pid != os.getpid():
                found.append(f"{process.pid} {' '.join(process.cmdline())} ({process.status()})")
        except psutil.Error:
            continue  # gone, or another user's
    return found


def growth(samples: list[dict]) -> dict:
    """Return how memory went after the first two minutes: medians of the first and last tenth, and a line's slope."""
    late = [sample for sample in samples if sample["at_s"] >= min(SETTLING_S, samples[-1]["at_s"] / 3)]
    at_h = np.array([sample["at_s"] for sample in late]) / 3600
    rss_mb = np.array([sample["rss_mb"] for sample in late])
    tenth = max(1, len(late) // 10)
    return {
        "rss_mb_first_tenth": float(np.median(rss_mb[:tenth])),
        "rss_mb_last_tenth": float(np.median(rss_mb[-tenth:])),
        "rss_mb_most": float(max(sample["rss_mb"] for sample in samples)),
        "rss_mb_per_hour": float(np.polyfit(at_h, rss_mb, 1)[0]) if len(late) > 2 else None,
        "threads_most": max(sample["threads"] for sample in samples),
        "threads_last_tenth": int(np.median([sample["threads"] for sample in late[-tenth:]])),
        "files_first_tenth": int(np.median([sample["files"] for sample in late[:tenth]])),
        "files_last_tenth": int(np.median([sample["files"] for sample in late[-tenth:]])),
    }


def main() -> int:
    """Soak, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--out", type=Path, help="JSON file of figures and samples")
    parser.add_argument("--child", nargs=2, metavar=("FOLDER", "STOP_AT"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        soak(Path(given.child[0]), float(given.child[1]))
        return 0
    token, start = uuid.uuid4().hex, time.time()
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        stop_at = start + 60 * given.minutes
        command = [sys.executable, __file__, "--child", name, str(stop_at)]
        child = subprocess.Popen(command, cwd=name, env=os.environ | {TOKEN: token})
        samples, zombies = watch(child, start)
        left = alive_with(token)
        runs = [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]
    statuses = sum((Counter(each["statuses"]) for each in runs), Counter())
    wrong = [f"run {each['run']}: {words}" for each in runs for words in each["wrong"]]
    figures = {
        "minutes": (time.time() - start) / 60,
        "exit_code": child.returncode,
        "runs": len(runs),
        "trials": sum(each["rows"] for each in runs),
        "statuses": dict(sorted(statuses.items())),
        "wrong_rows": wrong,
        "zombies": zombies,
        "left_alive": left,
        **growth(samples),
    }
    print(json.dumps(figures, indent=1))
    if given.out:
        given.out.write_text(json.dumps({**figures, "samples": samples}, indent=1) + "\n")
    return int(bool(wrong or zombies or left or child.returncode))


if __name__ == "__main__":
    sys.exit(main())
