"""LatentCEM's layers and planner against the naive forms, in one run. By hand: python benchmarks/bench_latentcem.py."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import torch
from torch.nn import functional

from regbench.learning.edge_convolution import EdgeConvolution
from regbench.learning.neighbours import nearest_neighbours
from regbench_latentcem.dynamics import EvaluationNetwork, TransformationNetwork, learned_reward
from regbench_latentcem.encoder import DgcnnEncoder
from regbench_latentcem.planner import generators_of, plan

CLOUDS, POINTS, REPEATS = 4, 784, 7


def naive_edge(layer: EdgeConvolution, features: torch.Tensor) -> torch.Tensor:
    distances = torch.cdist(features, features)
    neighbours = distances.sort(dim=2).indices[:, :, : layer.k]
    batch = torch.arange(len(features))[:, None, None]
    near = features[batch, neighbours]
    centre = features[:, :, None].expand_as(near)
    return functional.leaky_relu(layer.edge(torch.cat([near - centre, centre], dim=3)), 0.2).amax(dim=2)


def naive_encoder(encoder: DgcnnEncoder, clouds: torch.Tensor) -> torch.Tensor:
    features, answers = clouds, []
    for layer in encoder.convolutions:
        features = naive_edge(layer, features)
        answers.append(features)
    return functional.leaky_relu(encoder.last(torch.cat(answers, dim=2)), 0.2).amax(dim=1)


def compare(what: str, forms: dict[str, Callable[[], object]]) -> None:
    """Time the forms in turns, after a warm-up, and print medians and the ratio of the first to each."""
    samples: dict[str, list[float]] = {name: [] for name in forms}
    for round_ in range(REPEATS + 1):
        for name, form in forms.items():
            start = time.perf_counter()
            form()
            if round_:
                samples[name].append((time.perf_counter() - start) * 1e3)
    medians = {name: statistics.median(values) for name, values in samples.items()}
    first = next(iter(medians.values()))
    for name, median in medians.items():
        print(f"{what:34s} {name:12s} {median:9.2f} ms  x{first / median:.2f}")


def main() -> None:
    torch.manual_seed(0)
    encoder, clouds = DgcnnEncoder(), torch.randn(CLOUDS, POINTS, 3) * 0.5

    def step(form: Callable[[], torch.Tensor]) -> None:
        encoder.zero_grad()
        form().square().sum().backward()

    compare(
        f"DGCNN, {CLOUDS} clouds, with gradients",
        {
            "naive": lambda: step(lambda: naive_encoder(encoder, clouds)),
            "factorised": lambda: step(lambda: encoder(clouds)),
        },
    )
    features = torch.randn(CLOUDS, POINTS, 64)
    compare(
        f"20 neighbours, {CLOUDS} x {POINTS} x 64",
        {
            "full sort": lambda: torch.cdist(features, features).sort(dim=2).indices[:, :, :20],
            "selection": lambda: nearest_neighbours(features, 20),
        },
    )
    f, d = TransformationNetwork().requires_grad_(False), EvaluationNetwork().requires_grad_(False)
    z_source, z_target = torch.randn(1, 512), torch.randn(1, 512)

    def naive_reward(actions: torch.Tensor) -> torch.Tensor:
        count = actions.shape[1]
        return -d(f(z_source[:, None].expand(-1, count, -1), actions), z_target[:, None].expand(-1, count, -1))

    def search(make: Callable[[], Callable[[torch.Tensor], torch.Tensor]]) -> None:
        start, sigma = torch.zeros(1, 6), torch.ones(1, 6)
        plan(make(), start, sigma, iterations=10, candidates=1000, elites=25, generators=generators_of([0]))

    left, right = torch.randn(1000, 512), torch.randn(512, 512)
    compare(
        "planner, T 10, N 1000, width 512",
        {
            "naive": lambda: search(lambda: naive_reward),
            "factorised": lambda: search(lambda: learned_reward(f, d, z_source, z_target)),
            "floor": lambda: [left @ right for _ in range(30)],  # the three products that are left
        },
    )


if __name__ == "__main__":
    main()
