"""The dask executor: the same trials in the same isolated workers, on whatever machines a dask scheduler has."""

from __future__ import annotations

import importlib.util
import logging
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regbench.errors import UserError
from regbench.runner.local import check_cores
from regbench.runner.plan import Plan, RunConfig, Trial

if TYPE_CHECKING:
    from distributed import Client, Future

Row = dict[str, Any]

# Blocks sent to dask for each of its threads: one that runs, one that waits. More would only be load on the scheduler.
BLOCKS_AHEAD = 2
CONNECT_S = 10
CLOSE_S = 5


class DaskExecutor:
    """Sends blocks of trials to dask workers; each of their threads is a lane with cores of its own."""

    def check(self, config: RunConfig) -> None:
        """Refuse where dask is not installed, or has too few cores here; see `Executor.check`."""
        if importlib.util.find_spec("distributed") is None:
            raise UserError('--executor dask needs distributed, which is not installed: pip install "regbench[dask]"')
        if config.scheduler is None:
            check_cores(config.jobs, config.threads)

    def execute(
        self, plan: Plan, done: set[str], logs: Path, on_row: Callable[[Row], None], note: Callable[[str], None]
    ) -> Sequence[dict[str, Any]]:
        """Run what is not done; see `Executor.execute`."""
        from distributed.scheduler import KilledWorker

        from regbench.runner.dask_lanes import Lanes, Work

        fingerprints = [planned.fingerprint for planned in plan.methods]
        identities = [planned.identity for planned in plan.protocols]
        work = Work(plan.config, fingerprints, identities, plan.data_dir, logs.resolve())
        name = f"regbench-{uuid.uuid4().hex[:12]}"
        with _client(plan.config) as client:
            client.register_plugin(Lanes(name, work))
            try:
                machines = _ready(client, name)
                for rows in _results(client, name, plan.blocks(done)):
                    for row in rows:
                        on_row(row)
            except KilledWorker as error:
                raise UserError(
                    f"dask gave up on a block of trials: every worker that took it died ({error.last_worker.address} "
                    "was the last). Finished trials are in the journal; the same command continues"
                ) from error
            finally:
                with suppress(Exception):  # the scheduler may be gone, and what is raised above says so
                    client.unregister_worker_plugin(name)
        return machines


@contextmanager
def _client(config: RunConfig) -> Iterator[Client]:
    """Yield a client of the scheduler that the configuration names, or of one of its own."""
    from distributed import Client, LocalCluster

    _quieten()
    if config.scheduler is not None:
        try:
            client = Client(config.scheduler, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise UserError(f"--scheduler {config.scheduler}: no dask scheduler answers there ({reason})") from error
        try:
            yield client
        finally:
            client.close(timeout=CLOSE_S)
        return
    with (
        LocalCluster(
            n_workers=config.jobs,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            memory_limit=0,  # the methods' processes have limits, and a dask worker holds little else
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _quieten() -> None:
    """Let dask's loggers, each with a level of its own, be quiet: this run says in one line what becomes of it."""
    for name in [name for name in logging.root.manager.loggerDict if name.split(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)


def _ready(client: Client, name: str) -> list[dict[str, Any]]:
    """Return what machines there are.

    Raises:
        UserError: There are none, or one cannot take part.
    """
    from regbench.runner.dask_lanes import about_machine

    found = list(client.run(about_machine, name).values())
    if not found:
        address = _address(client)
        raise UserError(f"the dask scheduler at {address} has no workers; start some: `dask worker {address}`")
    for wrong, _ in found:
        if wrong is not None:
            raise UserError(wrong)
    return [machine for _, machine in found]


def _results(client: Client, name: str, blocks: Iterator[list[Trial]]) -> Iterator[list[Row]]:
    """Yield the rows of each block as it ends, with few blocks under way at a time.

    Raises:
        UserError: The scheduler is gone, or a machine cannot take part.
    """
    from distributed import as_completed

    from regbench.runner.dask_lanes import run_block

    under_way = as_completed(loop=client.loop, raise_errors=False)

    def send() -> None:
        threads = sum(client.nthreads().values())
        while under_way.count() < BLOCKS_AHEAD * max(1, threads) and (block := next(blocks, None)) is not None:
            under_way.add(client.submit(run_block, name, block, pure=False))

    address = _address(client)
    try:
        send()
        for future in under_way:
            yield _rows_of(future, address)
            send()
    except (OSError, TimeoutError) as error:
        raise _lost(address) from error


def _rows_of(future: Future[list[Row]], address: str) -> list[Row]:
    from concurrent.futures import CancelledError

    try:
        rows: list[Row] = future.result()
    except CancelledError as error:
        raise _lost(address) from error
    return rows


def _address(client: Client) -> str:
    return str(client.scheduler_info()["address"])


def _lost(address: str) -> UserError:
    return UserError(
        f"the dask scheduler at {address} is gone; finished trials are in the journal, the same command continues"
    )
