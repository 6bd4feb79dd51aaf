"""What dask costs: a run's trials a second with either executor, and how many blocks a scheduler hands out.

By hand: python benchmarks/bench_dask.py [--trials 5000] [--blocks 4000]. `identity` on demo@1 costs next to nothing, so
that what is measured is the runner and dask. Figures to docs/scale.md.
"""

from __future__ import annotations

import argparse
import json
import logging
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
from distributed import Client, LocalCluster, as_completed

BLOCK = 25


def main() -> None:
    """Print a line for each measurement."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=5000)
    parser.add_argument("--blocks", type=int, default=4000)
    arguments = parser.parse_args()
    for executor in ("local", "dask"):
        few, many = (run_s(executor, trials) for trials in (arguments.trials // 5, arguments.trials))
        rate = (arguments.trials - arguments.trials // 5) / (many - few)
        print(f"{executor}: {rate:.0f} trials a second beyond starting up ({many:.1f} s for {arguments.trials})")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    seconds, grown_mb = scheduler(arguments.blocks)
    print(
        f"a scheduler and one worker: {arguments.blocks / seconds:.0f} blocks a second, each answered by {BLOCK} rows; "
        f"this process, which holds the scheduler, grew by {grown_mb:.0f} MB over {arguments.blocks} blocks"
    )


def run_s(executor: str, trials: int) -> float:
    """Return the seconds that a run of `identity` takes, each problem of the demo several times."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "regbench", "run", "--method", "identity", "--limit", "100"]
        command += ["--repeat", str(trials // 100), "--executor", executor, "--out", str(Path(folder) / "run")]
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        return time.perf_counter() - start


def scheduler(blocks: int) -> tuple[float, float]:
    """Return the seconds for so many blocks, as few under way as in a run, and the growth of this process in MB."""
    row = json.dumps({"key": "0" * 32, "T_target_source": [[0.123456789012345] * 4] * 4, "more": "x" * 400})
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        under_way = as_completed(loop=client.loop)
        numbers: Iterator[int] = iter(range(blocks))

        def send() -> None:
            while under_way.count() < 2 and (number := next(numbers, None)) is not None:
                under_way.add(client.submit(_answer, number, row, pure=False))

        send()
        resident = psutil.Process().memory_info().rss
        start = time.perf_counter()
        for future in under_way:
            future.result()
            send()
        return time.perf_counter() - start, (psutil.Process().memory_info().rss - resident) / 2**20


def _answer(number: int, row: str) -> list[str]:
    return [row] * BLOCK


if __name__ == "__main__":
    main()
