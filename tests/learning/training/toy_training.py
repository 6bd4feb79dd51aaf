"""A small Trainable, also a plugin file: a linear map under noise, with dropout, so that all randomness counts."""

import os
import time

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict
from torch import nn

from regbench.learning.training.recipe import read_table, recipe_of
from regbench.learning.training.trainable import Trainable

MAP = np.array([[1.0, -2.0, 0.5], [0.0, 1.0, 3.0]], dtype=np.float32)


class Settings(BaseModel):
    """The toy's [method] table."""

    model_config = ConfigDict(extra="forbid")

    width: int = 4
    random: bool = True
    pace_s: float = 0.0


class Toy(Trainable):
    """Learns a fixed linear map."""

    name = "toy"
    monitor = "error"
    signal_at: tuple[int, int] | None = None  # (call of losses, signal)
    crash_at: int | None = None
    nan_at: int | None = None

    def __init__(self, settings, *, data):
        super().__init__(settings, data=data)
        self.table = read_table(Settings, settings, "toy: [method]")
        self._calls = 0

    def network(self):
        width = self.table.width
        between = [nn.BatchNorm1d(width), nn.Dropout(0.2)] if self.table.random else []
        return nn.Sequential(nn.Linear(3, width), *between, nn.Linear(width, 2))

    def sample(self, rng, progress):
        x = rng.normal(size=3).astype(np.float32)
        return {"x": x, "y": MAP @ x + np.float32(0.1 * (1 - progress) * rng.normal())}

    def losses(self, network, batch, progress):
        self._calls += 1
        time.sleep(self.table.pace_s)
        if self.signal_at and self._calls == self.signal_at[0]:
            os.kill(os.getpid(), self.signal_at[1])
        if self._calls == self.crash_at:
            raise RuntimeError("the toy broke")
        predicted = network(batch["x"])
        fit = ((predicted - batch["y"]) ** 2).mean()
        if self._calls == self.nan_at:
            fit = fit * float("nan")
        return {"fit": fit, "size": 1e-3 * predicted.square().mean()}

    def validate(self, network):
        assert not any(module.training for module in network.modules())
        assert not torch.is_grad_enabled()
        weight = next(network.parameters())
        x = torch.randn(64, 3, generator=torch.Generator().manual_seed(5)).to(weight)
        error = (network(x) - x @ torch.from_numpy(MAP).T.to(weight)).square().mean()
        return {"error": float(error), "random": float(torch.rand(()))}

    def card(self):
        return {"data": "none", "configuration": self.table.model_dump()}


TRAINING = {
    "steps": 20,
    "batch": 6,
    "learning_rate": 0.01,
    "weight_decay": 0.01,
    "warm_up_steps": 3,
    "clip_gradient_norm": 1.0,
    "average": 0.9,
    "log_every": 4,
    "validate_every": 10,
    "checkpoint_every": 10,
}


def toy_recipe(**training):
    """The toy's recipe; keywords are of [training], and `method` is its own table."""
    method = training.pop("method", {})
    return recipe_of({"trains": "toy", "training": TRAINING | training, "method": method}, "toy", "recipe:")
