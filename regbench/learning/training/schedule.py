"""The learning rate and the decay of the averaged weights, as pure functions of the step."""

from __future__ import annotations

import math

from regbench.learning.training.recipe import Training


def learning_rate_at(training: Training, step: int) -> float:
    """Return the learning rate of a step, counted from 0.

    It rises linearly over the warm-up; then it is constant, or follows half a cosine that ends, at the last step, at
    `final_learning_rate` of the highest.
    """
    if step < training.warm_up_steps:
        return training.learning_rate * (step + 1) / training.warm_up_steps
    if training.schedule == "constant":
        return training.learning_rate
    share = (step - training.warm_up_steps) / max(1, training.steps - 1 - training.warm_up_steps)
    least = training.final_learning_rate
    return training.learning_rate * (least + (1 - least) * (1 + math.cos(math.pi * min(1.0, share))) / 2)


def average_decay_at(training: Training, step: int) -> float:
    """Return the decay of the averaged weights after `step` steps: less at first, so that the start is forgotten."""
    return min(training.average, (1 + step) / (10 + step))
