"""The part of a training that Lightning runs for every step: loss, optimiser, averaged weights. Needs lightning."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import torch
from lightning.pytorch import LightningModule
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from regbench.learning.training.loss_meter import LossMeter
from regbench.learning.training.recipe import Training
from regbench.learning.training.schedule import average_decay_at, learning_rate_at
from regbench.learning.training.seeds import STEP, seed_torch
from regbench.learning.training.trainable import Trainable


class TrainingModule(LightningModule):
    """A Trainable's network under its recipe.

    Attributes:
        network: Is trained.
        average: Its exponential moving average, or None.
        meter: The loss terms since the last row of the log.
    """

    def __init__(self, trainable: Trainable, training: Training, network: nn.Module) -> None:
        super().__init__()
        self.trainable, self.training_recipe = trainable, training
        self.network = network
        self.average = copy.deepcopy(network).requires_grad_(False) if training.average else None
        self.meter = LossMeter()

    @property
    def shipped(self) -> nn.Module:
        """What is validated and shipped: the averaged network where there is one."""
        return self.network if self.average is None else self.average

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Return AdamW. Its learning rates are set before each step, as functions of the step alone."""
        recipe = self.training_recipe
        groups = parameter_groups(self.network, self.trainable.learning_rate_factors(self.network))
        # Fused: several times faster on CPU. Lightning does not clip gradients for it in mixed precision.
        fused = not (recipe.precision.endswith("mixed") and recipe.clip_gradient_norm)
        return torch.optim.AdamW(groups, recipe.learning_rate, weight_decay=recipe.weight_decay, fused=fused)

    def on_train_batch_start(self, batch: Any, batch_idx: int) -> None:
        """Set all that a step depends on besides weights and batch, so that a resumed step is the same."""
        step = self.global_step
        seed_torch(self.training_recipe.seed, STEP, step, self.global_rank)
        for group in self.trainer.optimizers[0].param_groups:
            group["lr"] = group["factor"] * learning_rate_at(self.training_recipe, step)

    def training_step(self, batch: dict[str, Tensor], batch_idx: int) -> Tensor:
        """Return the sum of the loss terms."""
        step = self.global_step
        losses = self.trainable.losses(self.network, batch, step / self.training_recipe.steps)
        return self.meter.add(step + 1, losses)

    def optimizer_step(
        self,
        epoch: int,
        batch_idx: int,
        optimizer: Any,
        optimizer_closure: Callable[[], Any] | None = None,
    ) -> None:
        """Take the step, then move the averaged weights after it."""
        super().optimizer_step(epoch, batch_idx, optimizer, optimizer_closure)
        if self.average is not None:
            decay = average_decay_at(self.training_recipe, self.global_step)
            move_average(self.average, self.network, decay)


def parameter_groups(network: nn.Module, factors: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return the optimiser's groups, one for each factor on the learning rate; a name's longest beginning counts."""
    groups: dict[float, list[nn.Parameter]] = {}
    for name, parameter in network.named_parameters():
        fitting = [beginning for beginning in factors if name.startswith(beginning)]
        factor = factors[max(fitting, key=len)] if fitting else 1.0
        groups.setdefault(factor, []).append(parameter)
    return [{"params": parameters, "factor": factor} for factor, parameters in groups.items()]


@torch.no_grad()
def move_average(average: nn.Module, network: nn.Module, decay: float) -> None:
    """Set average = decay * average + (1 - decay) * network for every parameter; buffers are copied."""
    mix = get_ema_multi_avg_fn(decay)  # type: ignore[no-untyped-call]
    mix(list(average.parameters()), list(network.parameters()), 0)
    for buffer, source in zip(average.buffers(), network.buffers(), strict=True):
        buffer.copy_(source)
