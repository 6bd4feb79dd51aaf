"""A small Trainable: fits a linear map under noise, with dropout, so that every source of randomness counts."""

import os
import signal
from pathlib import Path

import numpy as np
import torch
from torch import nn

from regbench.errors import UserError
from regbench.learning.recipe import recipe_of
from regbench.learning.trainable import Trainable

MAP = np.array([[1.0, -2.0, 0.5], [0.0, 1.0, 3.0]], dtype=np.float32)


class Toy(Trainable):
    """Learns a fixed linear map."""

    name = "toy"
    monitor = "error"

    def __init__(self, settings, *, data):
        super().__init__(settings, data=data)
        if unknown := set(settings) - {"width", "nan_at", "signal_at", "signal", "touch"}:
            raise UserError(f"toy: unknown setting {sorted(unknown)}")
        self._calls = 0

    def network(self):
        width = self.settings.get("width", 4)
        return nn.Sequential(nn.Linear(3, width), nn.BatchNorm1d(width), nn.Dropout(0.2), nn.Linear(width, 2))

    def sample(self, rng, progress):
        x = rng.normal(size=3).astype(np.float32)
        return {"x": x, "y": MAP @ x + np.float32(0.1 * (1 - progress) * rng.normal())}

    def losses(self, network, batch, progress):
        step = round(progress * 1_000_000)
        predicted = network(batch["x"])
        fit = ((predicted - batch["y"]) ** 2).mean()
        self._calls += 1
        if self._calls == self.settings.get("signal_at"):
            os.kill(os.getpid(), getattr(signal, self.settings.get("signal", "SIGINT")))
        if self._calls == self.settings.get("nan_at"):
            fit = fit * float("nan")
        assert step >= 0
        return {"fit": fit, "size": 1e-3 * predicted.square().mean()}

    def validate(self, network):
        assert not network.training
        assert not torch.is_grad_enabled()
        x = torch.randn(64, 3, generator=torch.Generator().manual_seed(5))
        error = (network(x) - x @ torch.from_numpy(MAP).T).square().mean()
        torch.rand(7)  # what a validation draws must not change the training
        return {"error": float(error), "other": 1.0}

    def card(self):
        return {"data": "none", "configuration": dict(self.settings)}


def toy_recipe(**training):
    """The toy's recipe; keywords of [training], and `method` for its own table."""
    method = training.pop("method", {})
    defaults = {"steps": 20, "batch": 6, "learning_rate": 0.01, "log_every": 4, "validate_every": 5}
    defaults |= {"checkpoint_every": 10, "average": 0.9, "weight_decay": 0.01, "clip_gradient_norm": 1.0}
    return recipe_of({"trains": "toy", "training": defaults | training, "method": method}, "toy", "recipe:")


RECIPE = """trains = "toy"
[training]
steps = 20
batch = 6
log_every = 4
validate_every = 5
"""


def write_recipe(folder: Path) -> Path:
    """Write a recipe of the toy."""
    path = folder / "toy.toml"
    path.write_text(RECIPE)
    return path
