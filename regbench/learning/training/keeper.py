"""What a training keeps in its folder as it goes: log, picture, checkpoints, the best weights. Needs lightning."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import torch
from lightning.pytorch import Callback, LightningModule, Trainer
from torch import Tensor, nn

from regbench.errors import UserError
from regbench.learning.training.folder import TrainingFolder
from regbench.learning.training.log import LOSS, TrainingLog
from regbench.learning.training.log import VALIDATION as VALIDATION_COLUMN
from regbench.learning.training.module import TrainingModule
from regbench.learning.training.plot import plot_training
from regbench.learning.training.recipe import Recipe
from regbench.learning.training.schedule import learning_rate_at
from regbench.learning.training.seeds import VALIDATION, seed_torch
from regbench.learning.training.stop_request import StopRequest
from regbench.learning.weights import save_weights


class Progress(Protocol):
    """Shows how far a training is."""

    def start(self, folder: TrainingFolder, done: int, total: int) -> None:
        """Begin at step `done` of `total`."""

    def step(self, done: int, total: int) -> None:
        """Count a step."""

    def row(self, row: Mapping[str, float]) -> None:
        """Show a new row of the log."""


class NoProgress:
    """Shows nothing."""

    def start(self, folder: TrainingFolder, done: int, total: int) -> None:
        """Do nothing."""

    def step(self, done: int, total: int) -> None:
        """Do nothing."""

    def row(self, row: Mapping[str, float]) -> None:
        """Do nothing."""


class Keeper(Callback):
    """Logs, validates and saves at the steps that the recipe names; ends the training when asked to.

    Attributes:
        best: Step and figures of the best validation so far, or None.
        stop: The request to end.
    """

    def __init__(
        self,
        folder: TrainingFolder,
        recipe: Recipe,
        card: Mapping[str, Any],
        facts: Mapping[str, Any],
        progress: Progress,
    ) -> None:
        self._folder, self._recipe, self._card, self._facts = folder, recipe, dict(card), facts
        self._progress = progress
        self.stop = StopRequest()
        self.best: dict[str, Any] | None = None
        self._seconds_before = 0.0
        self._saved_step = 0

    def state_dict(self) -> dict[str, Any]:
        """Return what a checkpoint holds of this."""
        return {
            "seconds": self._seconds(),
            "best": self.best,
            "started_from": self._facts["started_from"],
            "card": self._card,
        }

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take over what a checkpoint holds of this."""
        self._seconds_before, self.best = state_dict["seconds"], state_dict["best"]

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Continue the log; take the signals back, for Lightning has set its own by now."""
        self._began = time.monotonic()
        self._saved_step = trainer.global_step
        if trainer.is_global_zero:
            self._log = TrainingLog(self._folder.log, until=trainer.global_step)
            self._progress.start(self._folder, trainer.global_step, self._recipe.training.steps)
        self.stop.listen()

    def on_train_batch_end(
        self, trainer: Trainer, pl_module: LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Do what is due after this step."""
        assert isinstance(pl_module, TrainingModule)
        training, step = self._recipe.training, trainer.global_step
        # All processes end at the same step, whichever of them got the signal.
        stopping = trainer.strategy.reduce_boolean_decision(self.stop.signal is not None, all=False)
        last = step == training.steps
        validating = last or step % training.validate_every == 0
        saving = last or stopping or step % training.checkpoint_every == 0
        if validating or saving or step % training.log_every == 0:
            row = self._averages(trainer, pl_module, step, check_weights=validating or saving)
            figures = self._validate(trainer, pl_module) if validating else {}
            row |= {VALIDATION_COLUMN + name: value for name, value in figures.items()}
            if trainer.is_global_zero:
                self._log.add(row)
                self._progress.row(row)
                if validating:
                    plot_training(self._log.rows, self._folder.plot)
            if validating:
                self._keep_best(trainer, pl_module, step, figures)
        if saving:
            _save_checkpoint(trainer, self._folder.last)
            self._saved_step = step
        if trainer.is_global_zero:
            self._progress.step(step, training.steps)
        if stopping:
            trainer.should_stop = True

    def _averages(
        self, trainer: Trainer, module: TrainingModule, step: int, *, check_weights: bool
    ) -> dict[str, float]:
        def mean(values: Tensor) -> Tensor:
            reduced: Tensor = trainer.strategy.reduce(values, reduce_op="mean")
            return reduced

        try:
            losses = module.meter.flush(mean)
            if check_weights:
                _check_finite(module.network, step)
        except UserError as error:
            kept = (
                f"the checkpoint of step {self._saved_step} is kept"
                if self._saved_step
                else "no checkpoint was due yet"
            )
            raise UserError(
                f"training {self._folder.path}: {error}; {kept} ({self._folder.checkpoints}); in another --out, try a "
                "lower training.learning_rate or training.clip_gradient_norm"
            ) from None
        rate = learning_rate_at(self._recipe.training, step - 1)
        row = {"step": step, "seconds": self._seconds(), "learning_rate": rate}
        return row | {LOSS + name: value for name, value in losses.items()}

    def _validate(self, trainer: Trainer, module: TrainingModule) -> dict[str, float]:
        figures = self._figures(module) if trainer.is_global_zero else {}
        broadcast: dict[str, float] = trainer.strategy.broadcast(figures)
        return broadcast

    def _keep_best(self, trainer: Trainer, module: TrainingModule, step: int, figures: dict[str, float]) -> None:
        monitor = module.trainable.monitor
        lowest = math.inf if self.best is None else self.best["figures"][monitor]
        if figures[monitor] < lowest:
            self.best = {"step": step, "figures": figures}
            if trainer.is_global_zero:
                self._ship(module, step)
            _save_checkpoint(trainer, self._folder.best)

    def _figures(self, module: TrainingModule) -> dict[str, float]:
        seed_torch(self._recipe.training.seed, VALIDATION)
        with _evaluating(module.shipped), torch.no_grad():
            figures = {name: float(value) for name, value in module.trainable.validate(module.shipped).items()}
        if module.trainable.monitor not in figures:
            raise UserError(
                f"validate() of {type(module.trainable).__name__} gives no '{module.trainable.monitor}', which is its "
                f"`monitor` (it gives: {', '.join(figures) or 'nothing'})"
            )
        return figures

    def _ship(self, module: TrainingModule, step: int) -> None:
        assert self.best is not None
        trainable = module.trainable
        card = {
            **self._card,
            "method": self._recipe.trains,
            "recipe": self._recipe.as_dict(),
            "seed": self._recipe.training.seed,
            "steps": step,
            "hours": round(self._seconds() / 3600, 4),
            **self._facts,
            "monitor": trainable.monitor,
            "validation": self.best["figures"],
            "curve": [*self._facts.get("curve", []), *self._curve()],
        }
        save_weights(self._folder.weights, trainable.tensors(module.shipped), card)

    def _curve(self) -> list[dict[str, float]]:
        """Return each validation so far, by the samples seen and the hours, those of earlier trainings counted too."""
        before = self._facts.get("before", {"samples": 0, "hours": 0.0})
        points = []
        for row in self._log.rows:
            figures = {
                name.removeprefix(VALIDATION_COLUMN): value
                for name, value in row.items()
                if name.startswith(VALIDATION_COLUMN)
            }
            if figures:
                samples = before["samples"] + int(row["step"]) * self._recipe.training.batch
                hours = round(before["hours"] + row["seconds"] / 3600, 4)
                points.append({"samples": samples, "hours": hours, **figures})
        return points

    def _seconds(self) -> float:
        return self._seconds_before + time.monotonic() - self._began


def _save_checkpoint(trainer: Trainer, path: Path) -> None:
    """Save under a name beside it and rename: Lightning's own way goes through the folder of temporary files."""
    partial = path.with_suffix(".partial")
    try:
        trainer.save_checkpoint(partial, weights_only=False)
        if trainer.is_global_zero:
            partial.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error


def _check_finite(network: nn.Module, step: int) -> None:
    for name, weight in network.named_parameters():
        if not bool(torch.isfinite(weight).all()):
            raise UserError(f"the weight '{name}' is not finite after step {step}")


@contextmanager
def _evaluating(network: nn.Module) -> Iterator[None]:
    """Put a network in eval mode, and each of its modules back in its own."""
    before = [(module, module.training) for module in network.modules()]
    network.eval()
    try:
        yield
    finally:
        for module, mode in before:
            module.training = mode
