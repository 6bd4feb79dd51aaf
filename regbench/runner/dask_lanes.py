"""A run's part in a dask worker: lanes, one for each of its threads, in which trials run as they do on one machine."""

from __future__ import annotations

import os
import socket
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from distributed import Worker, WorkerPlugin, get_worker

from regbench.errors import UserError
from regbench.registry import MethodRegistry, find_protocol, parse_methods
from regbench.runner.cores import ClaimedCores
from regbench.runner.hardware import hardware
from regbench.runner.lane import Lane
from regbench.runner.manifest import versions
from regbench.runner.plan import PlannedMethod, ProtocolIdentity, RunConfig, Trial, plan_method

Row = dict[str, Any]


@dataclass(frozen=True)
class Work:
    """What a dask worker must know of a run: nothing but plain values, so that no method is pickled.

    Attributes:
        config: The run's.
        fingerprints: Of its methods, in the order of the plan.
        protocols: Likewise.
        data_dir: Where the run that sends this has its data.
        logs: Its folder for what methods print.
    """

    config: RunConfig
    fingerprints: Sequence[str]
    protocols: Sequence[ProtocolIdentity]
    data_dir: Path
    logs: Path


class Lanes(WorkerPlugin):
    """The run's lanes in one dask worker; dask hands it to each worker, also to those that come later.

    Attributes:
        wrong: Why this machine cannot take part, or None.
    """

    def __init__(self, name: str, work: Work) -> None:
        self.name, self._work = name, work
        self.wrong: str | None = None

    def setup(self, worker: Worker) -> None:
        """Look whether methods and data are here."""
        self._lanes: dict[int, tuple[Lane, ClaimedCores]] = {}
        self._lock = threading.Lock()
        try:
            self._methods = self._resolved()
            self._data_dir = self._checked_data()
            self._logs = self._made_logs()
        except UserError as error:
            self.wrong = f"{socket.gethostname()}: {error}"

    def teardown(self, worker: Worker) -> None:
        """Let the methods' processes go."""
        with self._lock:
            for lane, cores in self._lanes.values():
                lane.interrupt()
                lane.close()
                cores.free()
            self._lanes.clear()

    def rows(self, block: Sequence[Trial]) -> list[Row]:
        """Run trials in the lane of this thread.

        Raises:
            UserError: This machine cannot take part.
        """
        if self.wrong is not None:
            raise UserError(self.wrong)
        return list(self._lane().rows(block))

    def _lane(self) -> Lane:
        with self._lock:
            thread = threading.get_ident()
            if thread not in self._lanes:
                work = self._work
                cores = claimed_for_a_lane(work.config.threads)
                lane = Lane(work.config, self._methods, work.protocols, self._data_dir, cores.cores, self._logs)
                self._lanes[thread] = lane, cores
            return self._lanes[thread][0]

    def _resolved(self) -> list[PlannedMethod]:
        config = self._work.config
        registry = MethodRegistry([Path(path) for path in config.plugin])
        methods = [plan_method(registry.resolve(spec)) for spec in parse_methods(config.method)]
        for planned, fingerprint in zip(methods, self._work.fingerprints, strict=True):
            if planned.fingerprint != fingerprint:
                raise UserError(
                    f"method {planned.method.asked} is another here (its source, version or weights differ from those "
                    "where the run was started); install the same regbench and plugins on all machines"
                )
        return methods

    def _checked_data(self) -> Path:
        """Return the folder of the data: that of the run where it exists here too, else this machine's own."""
        folder = self._work.data_dir
        if not folder.is_dir():
            folder = Path(os.environ.get("REGBENCH_DATA") or folder)
        for protocol in self._work.protocols:
            if find_protocol(protocol.id).open(folder).data_sha256 != protocol.data_sha256:
                raise UserError(
                    f"{folder}: the data of {protocol.id} differ from those where the run was started; prepare the "
                    "same raw data here"
                )
        return folder

    def _made_logs(self) -> Path:
        """Return the run's folder for logs where machines share it, else one of this machine's own."""
        if self._work.logs.is_dir():
            return self._work.logs
        return Path(tempfile.mkdtemp(prefix=f"{self.name}-logs-"))


def claimed_for_a_lane(count: int) -> ClaimedCores:
    """Return so many cores, which no other lane on this machine holds.

    Raises:
        UserError: So many are not free.
    """
    claimed = ClaimedCores(count)
    if len(claimed.cores) < count:
        claimed.free()
        raise UserError(
            f"{socket.gethostname()}: a dask worker's thread needs {count} cores for itself, of the "
            f"{len(os.sched_getaffinity(0))} that it may use {len(claimed.cores)} are free: timed trials never share a "
            "core. Start workers with --nthreads 1, and fewer of them"
        )
    return claimed


def run_block(name: str, block: Sequence[Trial]) -> list[Row]:
    """Run trials where dask put them; see `Lanes.rows`."""
    return cast(Lanes, get_worker().plugins[name]).rows(block)


def about_machine(name: str, dask_worker: Worker) -> tuple[str | None, dict[str, Any]]:
    """Return why a worker's machine cannot take part, or None, and what it is."""
    return cast(Lanes, dask_worker.plugins[name]).wrong, {**hardware(), "versions": versions()}
