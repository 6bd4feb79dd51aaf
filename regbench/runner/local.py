"""The local executor: lanes, each with cores of its own and one worker a method."""

from __future__ import annotations

import os
import socket
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.runner.plan import Plan, RunConfig, Trial
from regbench.runner.process import WorkerProcess

Row = dict[str, Any]

# More methods than this take turns and pay their imports again with every block; each holds 100 to 300 MB.
OPEN_WORKERS = 32


def lane_cores(jobs: int, threads: int) -> list[list[int]]:
    """Return the cores of each lane: timed trials never share one. The run itself is left the lowest core if it can.

    Raises:
        UserError: There are not enough cores.
    """
    if not hasattr(os, "sched_getaffinity"):
        return [[] for _ in range(jobs)]
    cores = sorted(os.sched_getaffinity(0), reverse=True)
    if jobs * threads > len(cores):
        raise UserError(
            f"--jobs {jobs} with --threads {threads} needs {jobs * threads} cores, this process may use {len(cores)}: "
            "timed trials never share a core"
        )
    return [cores[lane * threads : (lane + 1) * threads] for lane in range(jobs)]


class LocalExecutor:
    """Runs trials in processes on this machine, `--jobs` at a time."""

    def check(self, config: RunConfig) -> None:
        """Refuse more jobs than there are cores for; see `Executor.check`."""
        lane_cores(config.jobs, config.threads)

    def execute(self, plan: Plan, done: set[str], logs: Path, on_row: Callable[[Row], None]) -> None:
        """Run what is not done; see `Executor.execute`."""
        shared = _Shared(plan, plan.blocks(done), logs, on_row)
        cores_of_lanes = lane_cores(plan.config.jobs, plan.config.threads)
        lanes = [_Lane(shared, cores) for cores in cores_of_lanes]
        with _kept_off({core for cores in cores_of_lanes for core in cores}):
            self._run(lanes, shared)
        if shared.failure is not None:
            raise shared.failure

    def _run(self, lanes: Sequence[_Lane], shared: _Shared) -> None:
        started: list[_Lane] = []
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


class _Lane:
    """Cores of its own, and the workers that take turns on them.

    Attributes:
        finished: Set when no worker is left. Not `Thread.is_alive`: in Python 3.11 a Ctrl-C during `Thread.join` makes
            a thread that runs on say that it is dead (python/cpython#90882).
    """

    def __init__(self, shared: _Shared, cores: Sequence[int]) -> None:
        self._shared, self._plan, self._cores = shared, shared.plan, cores
        self._workers: OrderedDict[int, WorkerProcess] = OrderedDict()
        self._host = socket.gethostname()
        self.finished = threading.Event()

    def run(self) -> None:
        """Take blocks until there is none."""
        try:
            while not self._shared.stop.is_set():
                block = self._shared.next_block()
                if block is None:
                    break
                for trial, ahead in zip(block, [*block[1:], None], strict=True):
                    outcome = self._outcome(trial, ahead)
                    if self._shared.stop.is_set():
                        return  # the worker was killed under it: no answer of the method's
                    self._shared.hand_over(self._row(trial, outcome))
        except BaseException as error:  # noqa: BLE001 - handed to the run, which ends with it
            self._shared.failure = error
            self._shared.stop.set()
        finally:
            for worker in self._workers.values():
                worker.close()
            self.finished.set()

    def interrupt(self) -> None:
        """Kill the workers, from another thread."""
        for worker in list(self._workers.values()):
            worker.interrupt()

    def _outcome(self, trial: Trial, ahead: Trial | None) -> Row:
        planned = self._plan.methods[trial.method]
        if planned.missing:
            return {"status": "missing", "error": planned.missing}
        worker = self._worker(trial.method)
        if worker.failed:
            return worker.failed
        following = self._request(ahead) if ahead is not None else None
        return worker.trial(self._request(trial), following, self._plan.config.timeout)

    def _request(self, trial: Trial) -> Row:
        return {
            "protocol": self._plan.protocols[trial.protocol].protocol.id,
            "data_sha256": self._plan.protocols[trial.protocol].problems.data_sha256,
            "problem": trial.problem,
            "repeat": trial.repeat,
            "seed": self._plan.config.seed,
        }

    def _worker(self, method: int) -> WorkerProcess:
        """Return the method's worker: the one that lives, or a new one. A method that cannot be prepared stays so."""
        worker = self._workers.get(method)
        if worker is None or not (worker.alive or worker.failed):
            while len(self._workers) >= OPEN_WORKERS:
                self._workers.popitem(last=False)[1].close()
            config = self._plan.config
            asked = self._plan.methods[method].method.asked
            worker = WorkerProcess(
                method=self._plan.methods[method].method,
                cores=self._cores,
                threads=config.threads,
                device=config.device,
                data_dir=self._plan.data_dir,
                memory_gb=config.memory,
                log=self._shared.logs / f"{asked.replace('/', '_')}.log",
            )
            self._workers[method] = worker  # before it prepares, so that an interrupt finds it
            worker.prepare()
        self._workers.move_to_end(method)
        return worker

    def _row(self, trial: Trial, outcome: Row) -> Row:
        planned = self._plan.methods[trial.method]
        protocol = self._plan.protocols[trial.protocol]
        return {
            "key": trial.key,
            "method": planned.method.asked,
            "protocol": protocol.protocol.id,
            "problem": trial.problem,
            "repeat": trial.repeat,
            "status": outcome["status"],
            "T_target_source": outcome.get("T_target_source"),
            "time_ms": outcome.get("time_ms"),
            "cpu_ms": outcome.get("cpu_ms"),
            "error": outcome.get("error"),
            "converged": outcome.get("converged"),
            "iterations": outcome.get("iterations"),
            "confidence": outcome.get("confidence"),
            "stages_s": outcome.get("stages_s", {}),
            "facts": outcome.get("facts", {}),
            "threads_ran": outcome.get("threads_ran"),
            "peak_rss_mb": outcome.get("peak_rss_mb"),
            "fingerprint": planned.fingerprint,
            "protocol_sha256": protocol.sha256,
            "host": self._host,
            "cores": list(self._cores),
            "timeout_s": self._plan.config.timeout,
            "memory_gb": self._plan.config.memory,
        }
