"""What --batch saves: wall time of a run's trials by problems at a time, each against one at a time.

By hand: python benchmarks/bench_batch.py [--methods idam,fmr] [--limit 48] [--device cpu]. Each run is a process of its
own in a temporary folder, in turns, `--rounds` times; the median is printed. Starting up is in it, the same for all.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIZES = (1, 4, 16)


def main() -> None:
    """Print a line for each method."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--methods", default="idam,fmr,pointnetlk,rpmnet,dcp")
    parser.add_argument("--limit", type=int, default=48)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    for method in arguments.methods.split(","):
        walls: dict[int, list[float]] = {size: [] for size in SIZES}
        for _ in range(arguments.rounds):
            for size in SIZES:
                walls[size].append(wall_s(method, size, arguments.limit, arguments.device))
        medians = {size: statistics.median(values) for size, values in walls.items()}
        words = ", ".join(f"batch {size}: {medians[size]:.1f} s ({medians[size] / medians[1]:.2f})" for size in SIZES)
        print(f"{method}, {arguments.limit} pairs of demo@1, {arguments.device}: {words}", flush=True)


def wall_s(method: str, size: int, limit: int, device: str) -> float:
    """Return the seconds that a run takes."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "regbench", "run", "--method", method, "--limit", str(limit)]
        command += ["--batch", str(size), "--device", device, "--out", str(Path(folder) / "run")]
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        return time.perf_counter() - start


if __name__ == "__main__":
    main()
