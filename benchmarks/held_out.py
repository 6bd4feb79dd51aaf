"""A learned baseline on training shapes that no training saw: what its settings are chosen by, never the test set.

By hand: python benchmarks/held_out.py "idam[iterations=3,10]" --kind noise [--points 784] [--pairs 100]. One
thread; the shapes after the 64 that trainings are validated on. Times are CPU time.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
import torch

from regbench.datasets.store import data_dir
from regbench.learning.training.clouds import TrainingClouds
from regbench.learning.training.pair_samples import draw_pair
from regbench.metrics.rotation import euler_residuals_deg, mae, rmse, rotation_error_deg
from regbench.registry import MethodRegistry, parse_methods

SEED = 7
HELD_OUT, VALIDATED = 300, 64


def main() -> None:
    """Print a line for each setting."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("methods")
    parser.add_argument("--kind", choices=("clean", "noise", "resampled", "partial"), default="noise")
    parser.add_argument("--points", type=int, default=784)
    parser.add_argument("--pairs", type=int, default=100)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    clouds = TrainingClouds("modelnet40", data_dir(None), arguments.points, HELD_OUT, "held_out")
    pairs = [
        draw_pair(
            clouds.cloud(int(index)),
            arguments.points,
            arguments.kind,
            "benchmark",
            0.8,
            np.random.Generator(np.random.PCG64([SEED, place])),
        )
        for place, index in enumerate(clouds.validated[VALIDATED : VALIDATED + arguments.pairs])
    ]
    truth = np.stack([pair["T_target_source"] for pair in pairs])[:, :3, :3].astype(np.float64)
    for spec in parse_methods([arguments.methods]):
        method = MethodRegistry([]).resolve(spec)
        registrar: Any = method.cls(**method.parameters)
        registrar.prepare()
        answers = []
        start = time.thread_time()
        with torch.inference_mode():
            for pair in pairs:
                source, target = (torch.from_numpy(pair[name])[None] for name in ("source", "target"))
                found = registrar._network.align(source, target, **registrar.options()).T_target_source
                answers.append(found[0, :3, :3].double().numpy())
        time_ms = 1e3 * (time.thread_time() - start) / len(pairs)
        errors, residuals = rotation_error_deg(np.stack(answers), truth), euler_residuals_deg(np.stack(answers), truth)
        print(
            f"{method.asked}, {arguments.kind}, {len(pairs)} pairs: "
            f"RMSE(R) {rmse(residuals):.3f}, MAE(R) {mae(residuals):.3f}, median {np.median(errors):.2f} deg, "
            f"recall 5 deg {(errors < 5).mean():.2f}, {time_ms:.0f} ms"
        )


if __name__ == "__main__":
    main()
