"""Trains a Trainable by a recipe, in a folder from which the same call continues. Lightning runs the loop."""

from __future__ import annotations

import importlib.util
import logging
import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.learning.budget import hours_by_device, training_budget
from regbench.learning.training.folder import TrainingFolder
from regbench.learning.training.recipe import Recipe

if TYPE_CHECKING:
    from torch import Tensor

    from regbench.learning.training.keeper import Progress
    from regbench.learning.training.trainable import Trainable
    from regbench.learning.weights import Weights

Device = Literal["auto", "cpu", "cuda"]


@dataclass(frozen=True)
class Outcome:
    """How a training ended.

    Attributes:
        folder: Where it lies.
        steps: Steps done.
        total: Steps that the recipe asks for.
        signal: Number of the signal that ended it early, or None.
        best: Step and figures of the best validation ({"step": ..., "figures": {...}}), or None.
        monitor: Which of the figures decides.
        is_main: False in the processes that Lightning starts for further devices.
    """

    folder: TrainingFolder
    steps: int
    total: int
    signal: int | None
    best: Mapping[str, Any] | None
    monitor: str
    is_main: bool = True

    def best_words(self) -> str:
        """Say which weights are the best so far, and where they are."""
        if self.best is None:
            return "no validation figure was finite, so there are no weights"
        figure = self.best["figures"][self.monitor]
        return f"best at step {self.best['step']}: {self.monitor} {figure:.4g}; {self.folder.weights}"


def train(
    trainable_class: type[Trainable],
    recipe: Recipe,
    out: Path,
    *,
    data: Path,
    device: Device = "auto",
    devices: int = 1,
    threads: int | None = None,
    start: Path | None = None,
    progress: Progress | None = None,
) -> Outcome:
    """Train, or continue the training that lies in `out`; see docs/training.md for what is written there.

    Args:
        trainable_class: The method's part.
        recipe: What to do.
        out: Folder of the training.
        data: Folder of the prepared datasets.
        device: "auto" is CUDA where there is one.
        devices: How many of them; each takes its share of every batch.
        threads: CPU threads; None leaves torch's own number.
        start: Weights to begin with instead of fresh ones; the optimiser begins anew.
        progress: Shows how far it is.

    Raises:
        UserError: Lightning is not installed, the device is not there, the folder holds something else, or a loss
            is not finite.
    """
    _check_installed()
    from regbench.learning.weights import load_weights

    if threads is not None:
        _use_threads(threads)
    on_cuda = _is_cuda(device)
    if recipe.training.batch % devices:
        raise UserError(f"training.batch = {recipe.training.batch} cannot be shared evenly by --devices {devices}")
    if on_cuda and devices > _count_of_gpus():
        raise UserError(f"--devices {devices}: torch finds {_count_of_gpus()} CUDA device(s) here")
    trainable = trainable_class(recipe.method, data=data)
    recipe = replace(recipe, method=dict(trainable.settings))
    folder = TrainingFolder(out, recipe.trains)
    # Lightning starts this very command once more for each further device, and numbers them so.
    is_main = devices == 1 or os.environ.get("LOCAL_RANK", "0") == "0"
    weights = load_weights(start) if start else None
    if is_main:
        folder.check(recipe)
    with folder.locked() if is_main else nullcontext(), _quiet():
        if is_main:
            write_atomically(folder.recipe, recipe.as_toml().encode())
        return _fit(trainable, recipe, folder, weights, on_cuda, devices, progress)


def _fit(
    trainable: Trainable,
    recipe: Recipe,
    folder: TrainingFolder,
    weights: Weights | None,
    on_cuda: bool,
    devices: int,
    progress: Progress | None,
) -> Outcome:
    import torch
    from lightning.fabric.plugins.environments.lightning import LightningEnvironment
    from lightning.pytorch import Trainer
    from lightning.pytorch.utilities.exceptions import SIGTERMException

    from regbench.learning.training.keeper import Keeper, NoProgress
    from regbench.learning.training.module import TrainingModule
    from regbench.learning.training.samples import batches
    from regbench.learning.training.seeds import NETWORK, seed_torch

    facts = {
        "device": _device_words(on_cuda, devices),
        "torch": torch.__version__,
        "started_from": weights.card["sha256"] if weights else None,
        **(_history(weights.card) if weights else {}),
    }
    card = trainable.card()
    checkpoint = _read_checkpoint(folder, facts["started_from"], card)
    done = checkpoint["global_step"] if checkpoint else 0
    training = recipe.training
    if done >= training.steps:
        best = checkpoint["callbacks"]["Keeper"]["best"] if checkpoint else None
        return Outcome(folder, done, training.steps, None, best, trainable.monitor)

    seed_torch(training.seed, NETWORK)
    network = trainable.network()
    if weights is not None:
        trainable.load(network, weights)
    module = TrainingModule(trainable, training, network)
    if checkpoint is not None:
        _check_same_networks(folder, checkpoint["state_dict"], module.state_dict())
    keeper = Keeper(folder, recipe, card, facts, progress or NoProgress())
    trainer = Trainer(
        accelerator="cuda" if on_cuda else "cpu",
        devices=devices,
        # A term that is switched off for some steps leaves weights without a gradient.
        strategy="ddp_find_unused_parameters_true" if devices > 1 else "auto",
        precision=training.precision,
        plugins=[LightningEnvironment()],  # one machine; a cluster's variables are not guessed at
        max_steps=training.steps,
        max_epochs=-1,
        gradient_clip_val=training.clip_gradient_norm or None,
        deterministic=training.deterministic or None,
        callbacks=[keeper],
        # The keeper does these; so nothing is written outside the folder.
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        use_distributed_sampler=False,
        default_root_dir=folder.path,
    )
    loader = batches(
        trainable, training, first=done, rank=trainer.global_rank, processes=trainer.world_size, pin=on_cuda
    )
    keeper.stop.listen()
    try:
        trainer.fit(
            module,
            loader,
            ckpt_path=folder.last if checkpoint else None,
            weights_only=True,  # nothing is unpickled but tensors and plain values
        )
    except SIGTERMException:
        pass  # the signal came before the first step, which was finished and saved all the same
    finally:
        keeper.stop.restore()
    signal = keeper.stop.signal if trainer.global_step < training.steps else None
    return Outcome(
        folder, trainer.global_step, training.steps, signal, keeper.best, trainable.monitor, trainer.is_global_zero
    )


def _history(card: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the card of the weights that a training starts from says of how they came to be."""
    try:
        return {
            "before": {**training_budget(card), "hours_by_device": hours_by_device(card)},
            "curve": list(card.get("curve", [])),
        }
    except (KeyError, TypeError, AttributeError):  # weights that were imported, or a card written by hand
        return {}


def _read_checkpoint(
    folder: TrainingFolder, started_from: str | None, card: Mapping[str, Any]
) -> dict[str, Any] | None:
    """Return the checkpoint to continue from, or None where there is none yet."""
    import torch

    if not folder.last.exists():
        return None
    try:
        checkpoint: dict[str, Any] = torch.load(folder.last, map_location="cpu", weights_only=True)
        kept = checkpoint["callbacks"]["Keeper"]
        before, made_for = kept["started_from"], kept["card"]
    except Exception as error:  # torch raises many kinds for a damaged file
        reason = " ".join(str(error).split())[:120]
        raise UserError(
            f"{folder.last}: cannot be read ({type(error).__name__}: {reason}); copy best.ckpt over it, or delete it "
            "to begin anew"
        ) from error
    if before != started_from:
        raise UserError(
            f"{folder.path}: holds a training that began from {_weights_words(before)}, --from now asks for "
            f"{_weights_words(started_from)}; give another --out"
        )
    changed = [key for key in {**made_for, **card} if made_for.get(key) != card.get(key)]
    if changed:
        key = changed[0]
        raise UserError(
            f"{folder.path}: holds a training whose {key} is {made_for.get(key)}, now it is {card.get(key)}; give "
            "another --out, or what it began with"
        )
    return checkpoint


def _check_same_networks(folder: TrainingFolder, kept: Mapping[str, Tensor], now: Mapping[str, Tensor]) -> None:
    """Raise where a checkpoint's networks are not those of the method as it is here."""
    shapes, expected = ({name: tuple(value.shape) for name, value in state.items()} for state in (kept, now))
    wrong = sorted(name for name in shapes.keys() | expected.keys() if shapes.get(name) != expected.get(name))
    if wrong:
        raise UserError(
            f"{folder.last}: of another version of {folder.name}, whose networks are others ({len(wrong)} tensors, "
            f"such as '{wrong[0]}'); give another --out"
        )


def _weights_words(sha256: str | None) -> str:
    return "fresh weights" if sha256 is None else f"weights of SHA-256 {sha256[:12]}..."


def _check_installed() -> None:
    for module in ("lightning", "matplotlib"):
        if importlib.util.find_spec(module) is None:
            raise UserError(f'training needs {module}, which is not installed: pip install "regbench[train]"')


def _use_threads(threads: int) -> None:
    import torch

    if threads < 1:
        raise UserError(f"--threads {threads}: at least one")
    torch.set_num_threads(threads)


def _is_cuda(device: Device) -> bool:
    import torch

    there = torch.cuda.is_available()
    if device == "cuda" and not there:
        raise UserError("--device cuda: torch finds no CUDA device here; `regbench doctor` says what it sees")
    return there and device != "cpu"


def _count_of_gpus() -> int:
    import torch

    return torch.cuda.device_count()


def _device_words(on_cuda: bool, devices: int) -> str:
    import torch

    if on_cuda:
        name = torch.cuda.get_device_name()
        return name if devices == 1 else f"{devices} x {name}"
    from regbench.runner.hardware import hardware

    threads = devices * torch.get_num_threads()
    return f"{hardware()['cpu']}, {threads} thread{'s' if threads > 1 else ''}"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Lightning's remarks off the screen: greetings, and advice that does not fit here."""
    import lightning.pytorch  # noqa: F401 - sets its logger's level when imported

    logger = logging.getLogger("lightning.pytorch")
    level = logger.level
    logger.setLevel(logging.WARNING)  # INFO: what devices there are, which are not used
    try:
        with warnings.catch_warnings():
            for message in _KNOWN_WARNINGS:
                warnings.filterwarnings("ignore", message=message)
            yield
    finally:
        logger.setLevel(level)


_KNOWN_WARNINGS = (
    # loader_workers is the recipe's choice: Lightning wants more of them, torch fewer.
    r"The 'train_dataloader' does not have many workers",
    r"This DataLoader will create \d+ worker processes",
    # Lightning 2.6 uses a name of torch that is deprecated since 2.12; nothing to be done here.
    r"`isinstance\(treespec, LeafSpec\)` is deprecated",
)
