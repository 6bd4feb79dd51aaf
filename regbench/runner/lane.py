"""A lane: cores of its own, and on them one worker a method, which run trials and make their rows."""

from __future__ import annotations

import socket
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any

from regbench.runner.hardware import hardware, machine_words
from regbench.runner.plan import PlannedMethod, ProtocolIdentity, RunConfig, Trial
from regbench.runner.process import WorkerProcess

Row = dict[str, Any]

# More methods than this take turns and pay their imports again with every block; each holds 100 to 300 MB.
OPEN_WORKERS = 32


class Lane:
    """Runs trials one after the other.

    Args:
        config: The run's.
        methods: The run's, in the plan's order.
        protocols: Likewise.
        data_dir: Where prepared datasets are on this machine.
        cores: The lane's own; empty for all.
        logs: Folder for what methods print.
    """

    def __init__(
        self,
        config: RunConfig,
        methods: Sequence[PlannedMethod],
        protocols: Sequence[ProtocolIdentity],
        data_dir: Path,
        cores: Sequence[int],
        logs: Path,
    ) -> None:
        self._config, self._methods, self._protocols = config, methods, protocols
        self._data_dir, self._cores, self._logs = data_dir, cores, logs
        self._workers: OrderedDict[int, WorkerProcess] = OrderedDict()
        self._place = {"host": socket.gethostname(), "machine": machine_words(hardware()), "cores": list(cores)}

    def rows(self, block: Sequence[Trial]) -> Iterator[Row]:
        """Run trials of one method and one protocol and yield their rows."""
        size = self._config.batch
        if size > 1 and self._methods[block[0].method].takes_batches:
            for first in range(0, len(block), size):
                yield from self._rows_of_batch(block[first : first + size])
            return
        for trial, ahead in zip(block, [*block[1:], None], strict=True):
            yield self._row(trial, self._outcome(trial, ahead))

    def _rows_of_batch(self, trials: Sequence[Trial]) -> Iterator[Row]:
        """Run trials at once or, where that fails, one by one: each then has its own status. None has a time."""
        outcomes = self._outcomes_of_batch(trials)
        together = outcomes is not None
        for trial, outcome in zip(trials, outcomes or repeat(None), strict=False):
            found = outcome or self._outcome(trial, None)
            untimed: Row = {"time_ms": None, "cpu_ms": None, "stages_s": {}}
            yield self._row(trial, found | untimed) | {"batch": len(trials) if together else 1}

    def _outcomes_of_batch(self, trials: Sequence[Trial]) -> Sequence[Row] | None:
        if self._methods[trials[0].method].missing or (worker := self._worker(trials[0].method)).failed:
            return None
        limit_s = self._config.timeout * len(trials)
        return worker.batch([self._request(trial) for trial in trials], limit_s)

    def interrupt(self) -> None:
        """Kill the workers, from another thread."""
        for worker in list(self._workers.values()):
            worker.interrupt()

    def close(self) -> None:
        """Let the workers go."""
        for worker in self._workers.values():
            worker.close()

    def _outcome(self, trial: Trial, ahead: Trial | None) -> Row:
        planned = self._methods[trial.method]
        if planned.missing:
            return {"status": "missing", "error": planned.missing}
        worker = self._worker(trial.method)
        if worker.failed:
            return worker.failed
        following = self._request(ahead) if ahead is not None else None
        return worker.trial(self._request(trial), following, self._config.timeout)

    def _request(self, trial: Trial) -> Row:
        protocol = self._protocols[trial.protocol]
        return {
            "protocol": protocol.id,
            "data_sha256": protocol.data_sha256,
            "problem": trial.problem,
            "repeat": trial.repeat,
            "seed": self._config.seed,
        }

    def _worker(self, method: int) -> WorkerProcess:
        """Return the method's worker: the one that lives, or a new one. A method that cannot be prepared stays so."""
        worker = self._workers.get(method)
        if worker is None or not (worker.alive or worker.failed):
            while len(self._workers) >= OPEN_WORKERS:
                self._workers.popitem(last=False)[1].close()
            asked = self._methods[method].method.asked
            worker = WorkerProcess(
                method=self._methods[method].method,
                cores=self._cores,
                threads=self._config.threads,
                device=self._config.device,
                data_dir=self._data_dir,
                memory_gb=self._config.memory,
                log=self._logs / f"{asked.replace('/', '_')}.log",
            )
            self._workers[method] = worker  # before it prepares, so that an interrupt finds it
            worker.prepare()
        self._workers.move_to_end(method)
        return worker

    def _row(self, trial: Trial, outcome: Row) -> Row:
        planned = self._methods[trial.method]
        protocol = self._protocols[trial.protocol]
        return {
            "key": trial.key,
            "method": planned.method.asked,
            "protocol": protocol.id,
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
            **self._place,
            "timeout_s": self._config.timeout,
            "memory_gb": self._config.memory,
        }
