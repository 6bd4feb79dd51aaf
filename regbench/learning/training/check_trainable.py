"""Tests what a Trainable promises the engine, for a method's own tests."""

from __future__ import annotations

import copy
import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.utils.data import default_collate

from regbench.learning.training.loss_meter import LossMeter
from regbench.learning.training.seeds import STEP, VALIDATION, sample_generator, seed_torch
from regbench.learning.training.trainable import Trainable
from regbench.learning.weights import load_weights, save_weights

BATCH = 2


def check_trainable(trainable: Trainable) -> list[str]:
    """Return what is wrong, a line each; a promise that raises is a line too.

    Samples are pure functions of their generator; losses are scalars whose gradient reaches every weight; figures of
    the validation repeat; weights come back from their file; the card is JSON.
    """
    problems: list[str] = []
    checks: list[Callable[[Trainable], Iterator[str]]] = [_samples, _losses, _validation, _weights, _card]
    for check in checks:
        try:
            problems += check(trainable)
        except Exception as error:  # noqa: BLE001 - a promise that raises is broken, whatever it raises
            problems.append(f"{check.__name__.strip('_')}: {type(error).__name__}: {error}")
    return problems


def _samples(trainable: Trainable) -> Iterator[str]:
    first, second = (trainable.sample(sample_generator(0, 3, 1), 0.5) for _ in range(2))
    for key, value in first.items():
        if not torch.equal(torch.as_tensor(value), torch.as_tensor(second[key])):
            yield f"sample: '{key}' differs for the same generator: it draws from elsewhere"
    third = trainable.sample(sample_generator(0, 3, 2), 0.5)
    if all(torch.equal(torch.as_tensor(value), torch.as_tensor(third[key])) for key, value in first.items()):
        yield "sample: does not depend on its generator"


def _batch(trainable: Trainable) -> dict[str, Tensor]:
    batch: dict[str, Tensor] = default_collate([trainable.sample(sample_generator(0, 0, i), 0.0) for i in range(BATCH)])
    return batch


def _losses(trainable: Trainable) -> Iterator[str]:
    fresh, batch = trainable.network(), _batch(trainable)
    totals = []
    for _ in range(2):
        # A copy: running statistics may change with every call.
        network = copy.deepcopy(fresh)
        seed_torch(0, STEP)
        totals.append(LossMeter().add(1, trainable.losses(network, batch, 0.0)))
    if not torch.equal(*totals):
        yield "losses: differ for the same batch and torch seed"
    if not bool(torch.isfinite(totals[0])):
        yield f"losses: their sum is {totals[0].item()} with fresh weights"
    weights = {name: weight for name, weight in network.named_parameters() if weight.requires_grad}
    gradients = torch.autograd.grad(totals[1], list(weights.values()), allow_unused=True)
    without = [name for name, gradient in zip(weights, gradients, strict=True) if gradient is None]
    if without:
        yield f"losses: no gradient reaches the weight '{without[0]}' ({len(without)} such)"


def _figures(trainable: Trainable, network: torch.nn.Module) -> dict[str, float]:
    seed_torch(0, VALIDATION)
    network.eval()
    with torch.no_grad():
        return trainable.validate(network)


def _validation(trainable: Trainable) -> Iterator[str]:
    network = trainable.network()
    first, second = (_figures(trainable, network) for _ in range(2))
    if trainable.monitor not in first:
        yield f"validate: gives no '{trainable.monitor}', which is the `monitor`"
    if first != second:
        yield "validate: figures differ for the same weights"


def _weights(trainable: Trainable) -> Iterator[str]:
    seed_torch(0)
    network, other = trainable.network(), trainable.network()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "check.safetensors"
        save_weights(path, trainable.tensors(network), {})
        trainable.load(other, load_weights(path))
    if _figures(trainable, network) != _figures(trainable, other):
        yield "load: the figures of the validation change when weights are saved and loaded"


def _card(trainable: Trainable) -> Iterator[str]:
    card: Any = trainable.card()
    try:
        if json.loads(json.dumps(card)) != card:
            yield "card: does not come back from JSON as it was"
    except (TypeError, ValueError) as error:
        yield f"card: {error}"
