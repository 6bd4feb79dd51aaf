"""LatentCEM's layers and planner against the naive forms, in one run. By hand: python benchmarks/bench_latentcem.py."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np
import torch
from torch.nn import functional

from regbench import Problem
from regbench.geometry.se3 import rotation_from_euler_deg, se3, transform
from regbench.learning.layers.edge_convolution import EdgeConvolution
from regbench.learning.layers.neighbours import nearest_neighbours
from regbench.testing.clouds import body
from regbench_latentcem.actions import move
from regbench_latentcem.dynamics import EvaluationNetwork, TransformationNetwork, learned_reward
from regbench_latentcem.encoder import DgcnnEncoder
from regbench_latentcem.losses import reconstruction_loss, training_losses, transformation_loss
from regbench_latentcem.model import LatentModel
from regbench_latentcem.planner import generators_of, plan
from regbench_latentcem.registrar import LatentCem
from regbench_latentcem.sampling import Sampling, draw_sample
from regbench_latentcem.support import start_as_support

CLOUDS, POINTS, REPEATS = 4, 784, 7


def naive_edge(layer: EdgeConvolution, features: torch.Tensor) -> torch.Tensor:
    distances = torch.cdist(features, features)
    neighbours = distances.sort(dim=2).indices[:, :, :20]
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


def naive_step(model: LatentModel, source: torch.Tensor, actions: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """Eq. 8 as printed, every cloud decoded, every product made."""
    moved = move(source, actions)
    clouds = torch.cat([source, moved, target])
    states = naive_encoder(model.encoder, clouds)
    z, z_moved, z_target = states.chunk(3)
    predicted = model.transformation(z, actions)
    loss = reconstruction_loss(model.decoder(states), clouds) + transformation_loss(predicted, z_moved)
    for state, cloud in ((z, source), (z_moved, moved)):
        true = naive_chamfer(cloud, target)
        loss = loss + (model.evaluation(state, z_target) - true).square().mean()
    return loss


def naive_chamfer(first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
    distances = torch.cdist(first, second)
    return distances.amin(dim=2).mean(dim=1) + distances.amin(dim=1).mean(dim=1)


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
        print(f"{what:46s} {name:12s} {median:9.2f} ms  x{first / median:.2f}")


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
    model = LatentModel()
    start_as_support(model)
    rng = np.random.default_rng(0)
    samples = [draw_sample(rng.normal(0, 0.4, (POINTS, 3)), POINTS, Sampling(copies=2), rng) for _ in range(CLOUDS)]
    batch = {name: torch.from_numpy(np.stack([sample[name] for sample in samples])) for name in samples[0]}

    def train(loss: Callable[[], torch.Tensor]) -> None:
        model.zero_grad()
        loss().backward()

    compare(
        f"training step, {CLOUDS} x (X, X', Y)",
        {
            "naive": lambda: train(
                lambda: naive_step(model, batch["source"], batch["actions"][:, 0], batch["copies"][:, 1])
            ),
            "ours": lambda: train(lambda: sum_of(training_losses(model, batch, decoded=1))),
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
    for widths in (((1024, 256), (256, 64)), ((512, 512), (512, 512))):
        compare_planners(*widths)
    time_calls()


def sum_of(terms: dict[str, torch.Tensor]) -> torch.Tensor:
    return torch.stack(list(terms.values())).sum()


def compare_planners(of_f: tuple[int, int], of_d: tuple[int, int]) -> None:
    f = TransformationNetwork(widths=of_f).requires_grad_(False)
    d = EvaluationNetwork(widths=of_d).requires_grad_(False)
    z_source, z_target = torch.randn(1, 512), torch.randn(1, 512)

    def naive_reward(actions: torch.Tensor) -> torch.Tensor:
        count = actions.shape[1]
        moved = f(z_source[:, None].repeat(1, count, 1), actions)
        joint = torch.cat([moved, z_target[:, None].expand(-1, count, -1)], dim=2)
        return -d.third(d.second(d.first(joint).relu()).relu()).squeeze(2)

    def search(make: Callable[[], Callable[[torch.Tensor], torch.Tensor]]) -> None:
        start, sigma = torch.zeros(1, 6), torch.ones(1, 6)
        plan(make(), start, sigma, iterations=10, candidates=1000, elites=25, generators=generators_of([0]))

    # The three products that are left.
    sizes = [(of_f[0], of_f[1]), (of_f[1], of_d[0]), of_d]
    left = [(torch.randn(1000, rows), torch.randn(rows, columns)) for rows, columns in sizes]
    compare(
        f"planner, T 10, N 1000, {of_f} {of_d}",
        {
            "naive": lambda: search(lambda: naive_reward),
            "factorised": lambda: search(lambda: learned_reward(f, d, z_source, z_target)),
            "floor": lambda: [rows @ columns for _ in range(10) for rows, columns in left],
        },
    )


def time_calls() -> None:
    """Time whole calls with the shipped weights, on 784 points, after a warm-up."""
    method = LatentCem()
    method.prepare()
    truth = se3(rotation_from_euler_deg([10.0, 30.0, 20.0]), np.zeros(3))
    samples: dict[str, list[float]] = {}
    for seed in range(REPEATS + 1):
        source = body(POINTS, seed=seed)
        problem = Problem(source=source, target=transform(truth, source), threads=torch.get_num_threads())
        start = time.perf_counter()
        answer = method.register(problem)
        took = {"call": time.perf_counter() - start, **answer.stages_s}
        for name in took if seed else ():
            samples.setdefault(name, []).append(took[name] * 1e3)
    words = ", ".join(f"{name} {statistics.median(values):.0f} ms" for name, values in samples.items())
    print(f"latentcem, {POINTS} points, torch threads: {torch.get_num_threads()}: {words}")


if __name__ == "__main__":
    main()
