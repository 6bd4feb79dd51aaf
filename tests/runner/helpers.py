"""What tests of runs share."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from regbench.runner.plan import RunConfig
from regbench.runner.run import run

FAULTY = Path(__file__).with_name("faulty_methods.py")
# A plugin file: slow enough to be stopped in its middle, and what it answers depends on problem and seed.
SLOW = """
import time

import numpy as np
from regbench import Registration

class Slow:
    name = "slow"
    def register(self, problem):
        time.sleep(0.03)
        T = np.eye(4)
        T[:3, 3] = problem.target.mean(axis=0) + np.random.default_rng(problem.seed).normal(size=3)
        return Registration(T_target_source=T)
"""


class Silent:
    """Progress that keeps what it is told."""

    def __init__(self):
        self.notes, self.rows = [], []

    def start(self, run, trials):
        self.total = sum(tally.total for tally in trials.values())
        self.done = sum(tally.done for tally in trials.values())

    def row(self, row):
        self.rows.append(row)

    def note(self, message):
        self.notes.append(message)


def run_here(out, **options):
    """Run in this process (methods in workers, as ever); return the rows and the progress."""
    progress = Silent()
    options.setdefault("plugin", [str(FAULTY)])
    run(RunConfig(out=str(out), **options), command=["test"], progress=progress)
    return rows_of(out), progress


def rows_of(out):
    return [json.loads(line) for line in (Path(out) / "trials.jsonl").read_text().splitlines()]


def regbench(*arguments, cwd=None, **options):
    """Run the command line in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "regbench", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=os.environ | options.pop("env", {}),
        timeout=300,
        **options,
    )


def wait_until(condition, seconds=60.0):
    """Wait for a condition, or fail."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)
