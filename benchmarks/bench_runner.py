"""What the runner adds to a trial, and how many trials a second it manages: run by hand, figures to docs/timing.md.

    python benchmarks/bench_runner.py

A method that does nothing is run on demo-like pairs of 784 and of 20,000 points. What the runner adds is the wall time
of the whole run between its first and its last row, divided by the trials, less the method's own time.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from regbench.runner.plan import RunConfig
from regbench.runner.run import run

NOTHING = """
import numpy as np
from regbench import Registration

class Nothing:
    name = "nothing"
    def register(self, problem):
        return Registration(T_target_source=np.eye(4))
"""


class Stopwatch:
    """Progress that keeps when each row came."""

    def __init__(self):
        self.times_s, self.own_ms = [], []

    def start(self, run, trials):
        pass

    def row(self, row):
        assert row["status"] == "ok", row
        self.times_s.append(time.perf_counter())
        self.own_ms.append(row["time_ms"])

    def note(self, message):
        print(message)


def pairs(folder, points, count):
    """Write a folder of pairs: `count` rows over 4 files, so that reading a file is part of what is measured."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    for name in ("a", "b", "c", "d"):
        np.save(folder / f"{name}.npy", rng.normal(size=(points, 3)))
    rows = [f"{'abcd'[k % 4]}.npy,{'bcda'[k % 4]}.npy" for k in range(count)]
    (folder / "pairs.csv").write_text("source,target\n" + "\n".join(rows) + "\n")
    return f"pairs:{folder}"


def measure(folder, protocol, limit, jobs=1):
    """Return milliseconds between rows less the method's own time (median), and trials per second."""
    watch = Stopwatch()
    config = RunConfig(
        method=["nothing"],
        protocol=[protocol],
        limit=limit,
        jobs=jobs,
        plugin=[str(folder / "nothing.py")],
        out=str(folder / f"run-{protocol.replace('/', '_')[-20:]}-{jobs}"),
    )
    run(config, command=["bench_runner"], progress=watch)
    gaps_ms = np.diff(watch.times_s) * 1e3
    rate = (len(watch.times_s) - 1) / (watch.times_s[-1] - watch.times_s[0])
    return statistics.median(gaps_ms - watch.own_ms[1:]), np.percentile(gaps_ms, 95), rate


def main():
    """Print the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "nothing.py").write_text(NOTHING)
        print(f"{'problems':32} {'added, median':>14} {'p95':>10} {'trials/s':>9}")
        cases = [
            ("demo@1 (784 points)", "demo@1", 224, 1),
            ("demo@1 (784 points), --jobs 2", "demo@1", 224, 2),
            ("files of 784 points", pairs(folder / "small", 784, 1000), 1000, 1),
            ("files of 20,000 points", pairs(folder / "large", 20_000, 400), 400, 1),
        ]
        for words, protocol, limit, jobs in cases:
            added_ms, p95_ms, rate = measure(folder, protocol, limit, jobs)
            print(f"{words:32} {added_ms:11.3f} ms {p95_ms:7.3f} ms {rate:9.0f}")
    helps_ms = []
    for _ in range(10):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "regbench", "--help"], stdout=subprocess.DEVNULL, check=True)
        helps_ms.append((time.perf_counter() - start) * 1e3)
    print(f"regbench --help: median {statistics.median(helps_ms):.0f} ms of 10")


if __name__ == "__main__":
    main()
