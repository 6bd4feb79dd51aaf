"""What a journal of a million rows costs: its size, and the time and memory to plan, resume and make its table.

    python benchmarks/bench_journal.py [--rows 1000000] [--methods 10]

The rows are as the runner writes them, keys and all, of `methods` methods on rows / methods problems each. Each
measurement is a process of its own, so that its peak memory is its own. Figures to docs/scale.md.
"""

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from regbench.geometry.se3 import rotation_from_euler_deg, se3

HEADLINE = ["rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t"]
MEASURED = ("table", "resume", "survey", "plan")


def write_run(folder, rows, methods):
    """Write a run folder of `rows` trials."""
    problems = rows // methods
    rng = np.random.default_rng(0)
    angles = rng.uniform(-45, 45, (problems, 3))
    truths = [se3(rotation_from_euler_deg(a), a / 100).tolist() for a in angles]
    infos = [
        {
            "method": f"method{m}",
            "name": f"method{m}",
            "kind": "classical",
            "sees_ground_truth": False,
            "fingerprint": hashlib.sha256(str(m).encode()).hexdigest(),
        }
        for m in range(methods)
    ]
    sha256 = hashlib.sha256(b"problems").hexdigest()
    protocol = {"id": "bench@1", "description": "made by bench_journal", "dataset": None, "sha256": sha256}
    protocol |= {"n": problems, "headline_metrics": HEADLINE, "published": None}
    manifest = {
        "config": {"repeat": 1, "seed": 0, "threads": 1, "device": "cpu"},
        "hardware": {"hostname": "host", "cpu": "bench", "cores": 2},
        "methods": infos,
        "protocols": [protocol],
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with (folder / "problems.jsonl").open("w") as file:
        for problem, truth in enumerate(truths):
            row = {"protocol": "bench@1", "problem": problem, "T_target_source": truth, "label": "chair", "id": "x"}
            file.write(json.dumps(row, separators=(",", ":")) + "\n")
    with (folder / "trials.jsonl").open("w") as file:
        for problem, truth in enumerate(truths):
            for info in infos:
                file.write(json.dumps(trial(info, sha256, problem, truth, rng), separators=(",", ":")) + "\n")


def trial(info, sha256, problem, truth, rng):
    """Return a row as the runner writes one, of a method that fails once in 50 times."""
    failed = rng.random() < 0.02
    return {
        "key": hashlib.sha256(f"{info['fingerprint']} {problem}".encode()).hexdigest()[:32],
        "method": info["method"],
        "protocol": "bench@1",
        "problem": problem,
        "repeat": 0,
        "status": "timeout" if failed else "ok",
        "T_target_source": None if failed else truth,
        "time_ms": rng.exponential(10),
        "cpu_ms": rng.exponential(10),
        "error": "no answer after 60 s; killed" if failed else None,
        "converged": None if failed else True,
        "iterations": None if failed else int(rng.integers(50)),
        "confidence": None if failed else rng.random(),
        "stages_s": {},
        "facts": {},
        "threads_ran": 1,
        "peak_rss_mb": 237.13671875,
        "fingerprint": info["fingerprint"],
        "protocol_sha256": sha256,
        "host": "host",
        "hardware": "AMD EPYC, 2 cores",
        "cores": [1],
        "timeout_s": 60.0,
        "memory_gb": 8.0,
    }


def table(folder):
    """Make the table as `regbench table` does."""
    from regbench.report.table import render

    print(render([folder], format="text").splitlines()[4])


def resume(folder):
    """Open the journal and find what is done, as `regbench run` does."""
    from regbench.runner.journal import Journal
    from regbench.runner.plan import RunConfig
    from regbench.runner.run import done_keys

    with Journal(folder / "trials.jsonl"):
        print(len(done_keys(folder / "trials.jsonl", RunConfig(method=["x"]))), "done")


class Problems:
    """As many small pairs as the run has problems: what is measured is the runner's share, not that of the points."""

    data_sha256 = "0" * 64

    def __init__(self, n):
        self.n = n
        self.points = np.zeros((3, 3))

    def __len__(self):
        return self.n

    def __iter__(self):
        motion = se3(rotation_from_euler_deg((10, 20, 30)), (0.1, 0.2, 0.3))
        for problem in range(self.n):
            pair = SimpleNamespace(source=self.points, target=self.points, T_target_source=motion)
            pair.label, pair.id = "chair", f"{problem}"
            yield pair


def planned(folder):
    """Return the plan of the run in the folder."""
    from regbench.runner.plan import Plan, PlannedMethod, PlannedProtocol, RunConfig

    manifest = json.loads((folder / "manifest.json").read_text())
    (info,) = manifest["protocols"]
    methods = [
        PlannedMethod(SimpleNamespace(asked=method["method"]), method["fingerprint"], None)
        for method in manifest["methods"]
    ]
    problems = Problems(info["n"])
    protocol = PlannedProtocol(SimpleNamespace(id=info["id"]), problems, info["sha256"], info["n"])
    return Plan(RunConfig(method=["x"]), methods, [protocol], folder)


def survey(folder):
    """Go through all problems and write problems.jsonl, as `regbench run` does at its start."""
    from regbench.runner.run import survey as survey_problems
    from regbench.runner.rundir import RunDir, write_problems

    plan = planned(folder)
    copy = folder / "survey"
    copy.mkdir(exist_ok=True)
    _, lines = survey_problems("bench@1", plan.protocols[0].problems)
    write_problems(RunDir(copy), plan, {"bench@1": lines})
    print(len(lines), "problems")


def plan(folder):
    """Draw every block of a fresh run, as an executor does."""
    print(sum(map(len, planned(folder).blocks(set()))), "trials drawn")


def measure(what, folder, *arguments):
    """Run a function of this file in a process of its own; return its seconds, CPU seconds and peak memory in MB."""
    given = ", ".join([f"pathlib.Path({str(folder)!r})", *map(str, arguments)])
    code = f"import pathlib, bench_journal; bench_journal.{what}({given})"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent)}
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-c", code], env=environment)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{what} failed")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main():
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--methods", type=int, nargs="+", default=[10, 1])
    parser.add_argument("--repeats", type=int, default=1)
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for methods in arguments.methods:
        with tempfile.TemporaryDirectory(prefix="bench-journal-") as name:
            measure("write_run", name, arguments.rows, methods)
            journal, truths = (Path(name, file).stat().st_size for file in ("trials.jsonl", "problems.jsonl"))
            print(f"{arguments.rows} rows of {methods} methods: trials.jsonl {journal / 1e6:.0f} MB, ", end="")
            print(f"{journal / arguments.rows:.0f} bytes a row; problems.jsonl {truths / 1e6:.0f} MB", flush=True)
            for what in MEASURED:
                for _ in range(arguments.repeats):
                    elapsed_s, cpu_s, peak_mb = measure(what, Path(name))
                    print(f"  {what:7} {elapsed_s:6.1f} s  {cpu_s:6.1f} s of CPU  peak {peak_mb:6.0f} MB", flush=True)


if __name__ == "__main__":
    main()
