"""Batches of training samples by step: sample i of step s is the same whoever makes it, in whatever order."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from typing import Any

from torch.utils.data import DataLoader, Dataset, Sampler

from regbench.learning.training.recipe import Training
from regbench.learning.training.seeds import sample_generator
from regbench.learning.training.trainable import Sample, Trainable


class _Samples(Dataset[Sample]):
    """Samples by (step, index in the batch)."""

    def __init__(self, trainable: Trainable, training: Training) -> None:
        self._trainable, self._training = trainable, training

    def __getitem__(self, key: tuple[int, int]) -> Sample:
        step, index = key
        rng = sample_generator(self._training.seed, step, index)
        return self._trainable.sample(rng, step / self._training.steps)


class _Steps(Sampler[list[tuple[int, int]]]):
    """The keys of every step's batch, from the step where the training continues; of this process's part of it."""

    def __init__(self, training: Training, first: int, rank: int, processes: int) -> None:
        self._training, self._first, self._rank, self._processes = training, first, rank, processes

    def __iter__(self) -> Iterator[list[tuple[int, int]]]:
        for step in range(self._first, self._training.steps):
            yield [(step, index) for index in range(self._rank, self._training.batch, self._processes)]


def batches(
    trainable: Trainable, training: Training, *, first: int = 0, rank: int = 0, processes: int = 1, pin: bool = False
) -> DataLoader[Any]:
    """Return the batches of the steps from `first` on.

    Args:
        trainable: Makes the samples.
        training: The recipe's; `loader_workers` processes make samples ahead.
        first: Step to begin with.
        rank: Of this process among `processes`, which share each batch evenly.
        processes: One for each device.
        pin: Put batches in page-locked memory, for CUDA.
    """
    return DataLoader(
        _Samples(trainable, training),
        batch_sampler=_Steps(training, first, rank, processes),
        num_workers=training.loader_workers,
        pin_memory=pin,
        worker_init_fn=_ignore_interrupts,
    )


def _ignore_interrupts(worker: int) -> None:
    """Leave Ctrl-C, which a terminal sends to all, to the training, which still needs batches to finish its step."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
