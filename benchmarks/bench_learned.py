"""The learned baselines against plain renderings of the same networks, in one run.

By hand: python benchmarks/bench_learned.py [--threads 2] [--rounds 9]. Batch 1, 784 points, the package's weights.
Contenders take turns; times are medians over rounds. That both answer the same is tested in tests/baselines.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from plain import dcp, idam, pointnetlk, rpmnet
from torch import Tensor

from regbench.learning.layers.lucas_kanade import numerical_jacobian
from regbench.learning.layers.pointnet import pooled
from regbench.learning.layers.pointnet_jacobian import pointnet_jacobian
from regbench.learning.training.pair_samples import draw_pair
from regbench.learning.weights import load_weights
from regbench.registry import MethodRegistry, parse_methods
from regbench.testing.clouds import body

POINTS = 784
# Of ours, what the plain rendering does too.
AS_PUBLISHED = {"jacobian": "numerical", "descent": False, "from_mean": False, "iterations": 10}


def contenders(name: str, source: Tensor, target: Tensor) -> tuple[Callable[[], object], Callable[[], object]]:
    """Return ours and the plain rendering, with the same weights and the same work."""
    method = MethodRegistry([]).resolve(parse_methods([name])[0])
    registrar: Any = method.cls(**method.parameters)
    registrar.prepare()
    network, options = registrar._network, registrar.options()
    configuration = load_weights(registrar.data_files()[0]).card["configuration"]
    state = network.state_dict()
    if name in ("pointnetlk", "fmr"):
        plain: Any = pointnetlk.from_ours(state, configuration)
        options, plain_options = AS_PUBLISHED, {"iterations": 10}
    elif name == "rpmnet":
        plain = rpmnet.PlainRpmNet(**{key: value for key, value in configuration.items() if key != "normals"})
        plain.load_ours(state)
        plain_options = options
    else:
        options = options | registrar.presets["paper"]
        plain = {"idam": idam, "dcp": dcp}[name].from_ours(state, configuration)  # type: ignore[attr-defined]
        plain_options = {key: value for key, value in options.items() if key != "iterations"}
    plain = plain.eval().requires_grad_(False)
    answer = plain if name == "rpmnet" else plain.align
    return lambda: network.align(source, target, **options), lambda: answer(source, target, **plain_options)


def medians_ms(functions: list[Callable[[], object]], rounds: int) -> list[float]:
    """Return each function's median time; they take turns."""
    times: list[list[float]] = [[] for _ in functions]
    for turn in range(rounds + 2):
        for place, function in enumerate(functions):
            start = time.perf_counter()
            function()
            if turn >= 2:
                times[place].append(1e3 * (time.perf_counter() - start))
    return [statistics.median(samples) for samples in times]


def main() -> None:
    """Print a line for each method, and one for the Jacobians."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    pair = draw_pair(body(1024), POINTS, "noise", "benchmark", 0.8, np.random.default_rng(0))
    source, target = (torch.from_numpy(pair[name])[None] for name in ("source", "target"))
    with torch.inference_mode():
        for name in ("pointnetlk", "fmr", "idam", "rpmnet", "dcp"):
            ours, plain = medians_ms(list(contenders(name, source, target)), arguments.rounds)
            print(f"{name:11} ours {ours:8.1f} ms   plain {plain:8.1f} ms   plain / ours {plain / ours:5.2f}")
        method: Any = MethodRegistry([]).resolve(parse_methods(["pointnetlk"])[0]).cls()
        method.prepare()
        layers = method._network.encoder.folded()
        features = pooled(layers, target)
        state = method._network.state_dict()
        configuration = load_weights(method.data_files()[0]).card["configuration"]
        plain_encoder = pointnetlk.from_ours(state, configuration).eval()
        analytical, numerical, six_plain = medians_ms(
            [
                lambda: pointnet_jacobian(layers, target),
                lambda: numerical_jacobian(layers, target, features, 1e-2),
                lambda: [plain_encoder(target) for _ in range(6)],
            ],
            arguments.rounds,
        )
    print(
        f"Jacobian: analytical {analytical:.1f} ms; six passes of our encoder {numerical:.1f} ms "
        f"({numerical / analytical:.2f} times), of the plain one {six_plain:.1f} ms ({six_plain / analytical:.2f})"
    )


if __name__ == "__main__":
    main()
