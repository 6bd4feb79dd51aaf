"""The local executor: lanes, each with cores of its own and one worker a method."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.runner.cores import ClaimedCores
from regbench.runner.lane import Lane
from regbench.runner.plan import Plan, RunConfig, Trial

Row = dict[str, Any]


def check_cores(jobs: int, threads: int) -> None:
    """Refuse more lanes than this process may use cores for.

    Raises:
        UserError: There are not enough cores.
    """
    if not hasattr(os, "sched_getaffinity"):
        return
    cores = len(os.sched_getaffinity(0))
    if jobs * threads > cores:
        raise UserError(
            f"--jobs {jobs} with --threads {threads} needs {jobs * threads} cores, this process may use {cores}: "
            "timed trials never share a core"
        )


@contextmanager
def _lane_cores(jobs: int, threads: int, note: Callable[[str], None]) -> Iterator[list[list[int]]]:
    """Yield the cores of each lane: the highest that no other run holds, then, saying so, those that one does."""
    if not hasattr(os, "sched_getaffinity"):
        yield [[] for _ in range(jobs)]
        return
    with ClaimedCores(jobs * threads) as claimed:
        missing = jobs * threads - len(claimed.cores)
        shared = sorted(os.sched_getaffinity(0) - set(claimed.cores), reverse=True)[:missing]
        if shared:
            note(
                f"another run holds core {', '.join(map(str, shared))}, this one uses it too: times of both are too "
                "long to be quoted"
            )
        cores = [*claimed.cores, *shared]
        yield [cores[lane * threads : (lane + 1) * threads] for lane in range(jobs)]


class LocalExecutor:
    """Runs trials in processes on this machine, `--jobs` at a time."""

    def check(self, config: RunConfig) -> None:
        """Refuse more jobs than there are cores for, and a scheduler; see `Executor.check`."""
        if config.scheduler is not None:
            raise UserError(f"--scheduler {config.scheduler}: only --executor dask has one")
        check_cores(config.jobs, config.threads)

    def execute(
        self, plan: Plan, done: set[str], logs: Path, on_row: Callable[[Row], None], note: Callable[[str], None]
    ) -> Sequence[dict[str, Any]]:
        """Run what is not done; see `Executor.execute`."""
        shared = _Shared(plan, plan.blocks(done), logs, on_row)
        with _lane_cores(plan.config.jobs, plan.config.threads, note) as cores_of_lanes:
            lanes = [_LaneThread(shared, cores) for cores in cores_of_lanes]
            with _kept_off({core for cores in cores_of_lanes for core in cores}):
                self._run(lanes, shared)
        if shared.failure is not None:
            raise shared.failure
        return []

    def _run(self, lanes: Sequence[_LaneThread], shared: _Shared) -> None:
        started: list[_LaneThread] = []
        try:
            for number, lane in enumerate(lanes):
                threading.Thread(target=lane.run, name=f"lane {number}").start()
                started.append(lane)
            for lane in started:
                while not (lane.finished.wait(0.1) or shared.stop.is_set()):
                    pass
        finally:
            shared.stop.set()
            for lane in started:
                while not lane.finished.wait(0.05):
                    lane.interrupt()  # again and again: a worker may just be starting


@contextmanager
def _kept_off(cores: set[int]) -> Iterator[None]:
    """Keep this process off the cores of timed trials where another is left.

    Else the kernel likes to wake it where the worker runs, in the worker's time.
    """
    if not hasattr(os, "sched_getaffinity") or not (rest := os.sched_getaffinity(0) - cores):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, rest)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


class _Shared:
    """What the lanes of one run share."""

    def __init__(self, plan: Plan, blocks: Iterator[list[Trial]], logs: Path, on_row: Callable[[Row], None]) -> None:
        self.plan, self.logs = plan, logs
        self._blocks = blocks
        self.stop = threading.Event()
        self.failure: BaseException | None = None
        self._on_row = on_row
        self._lock = threading.Lock()

    def next_block(self) -> list[Trial] | None:
        """Return the next block, or None; drawn one at a time, since a plan may have more trials than memory holds."""
        with self._lock:
            return next(self._blocks, None)

    def hand_over(self, row: Row) -> None:
        with self._lock:
            if not self.stop.is_set():
                self._on_row(row)


class _LaneThread:
    """A lane that takes the run's blocks, in a thread of its own.

    Attributes:
        finished: Set when no worker is left. Not `Thread.is_alive`: in Python 3.11 a Ctrl-C during `Thread.join` makes
            a thread that runs on say that it is dead (python/cpython#90882).
    """

    def __init__(self, shared: _Shared, cores: Sequence[int]) -> None:
        plan = shared.plan
        protocols = [planned.identity for planned in plan.protocols]
        self._shared = shared
        self._lane = Lane(plan.config, plan.methods, protocols, plan.data_dir, cores, shared.logs)
        self.finished = threading.Event()

    def run(self) -> None:
        """Take blocks until there is none."""
        try:
            while not self._shared.stop.is_set():
                block = self._shared.next_block()
                if block is None:
                    break
                for row in self._lane.rows(block):
                    if self._shared.stop.is_set():
                        return  # the worker was killed under it: no answer of the method's
                    self._shared.hand_over(row)
        except BaseException as error:  # noqa: BLE001 - handed to the run, which ends with it
            self._shared.failure = error
            self._shared.stop.set()
        finally:
            self._lane.close()
            self.finished.set()

    def interrupt(self) -> None:
        """Kill the lane's workers, from another thread."""
        self._lane.interrupt()
