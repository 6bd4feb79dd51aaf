"""What a learned method brings to its training: network, loss, sampling, validation. The engine does the rest."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

from regbench.learning.weights import Weights

Sample = dict[str, NDArray[Any] | Tensor]


class Trainable(ABC):
    """A learned method's part of a training: its network, its loss and its sampling.

    Found by the entry point group `regbench.trainables`, or in a `--plugin` file as a class with a `name`.

    Args:
        settings: The [method] table of the recipe.
        data: Folder of the prepared datasets.

    `settings` holds them, with every default if the method fills them in: recipe and model card have what is there.

    Raises:
        UserError: A setting is unknown or has a value it cannot have; `read_table` of recipe.py says so of a pydantic
            model.

    Attributes:
        monitor: The figure of `validate` that decides which weights are best; lower is better.
        recipes: Folder of the method's recipes (*.toml) and weights, or None.
        default_recipe: Which of them is used where none is named; needed where there are several.
    """

    monitor: ClassVar[str]
    recipes: ClassVar[Path | None] = None
    default_recipe: ClassVar[str | None] = None

    def __init__(self, settings: Mapping[str, Any], *, data: Path) -> None:
        self.settings = settings
        self.data = data

    @abstractmethod
    def network(self) -> nn.Module:
        """Return the network, freshly initialised. The engine has seeded torch's generator."""

    @abstractmethod
    def sample(self, rng: np.random.Generator, progress: float) -> Sample:
        """Return one training sample; the engine stacks a batch of them along a new first axis.

        A pure function of its arguments: it runs in loader processes, in any order.

        Args:
            rng: The sample's own generator, seeded by (seed, step, index in the batch).
            progress: Share of the training that is done, in [0, 1).
        """

    @abstractmethod
    def losses(self, network: nn.Module, batch: dict[str, Tensor], progress: float) -> dict[str, Tensor]:
        """Return the loss terms of a batch by name, each a scalar, weighted; their sum is minimised, all are logged.

        Torch's generators are seeded by (seed, step) before the call.
        """

    @abstractmethod
    def validate(self, network: nn.Module) -> dict[str, float]:
        """Return figures on held-out shapes, `monitor` among them. The network is in eval mode, without gradients."""

    def learning_rate_factors(self, network: nn.Module) -> dict[str, float]:
        """Return factors on the recipe's learning rate by the beginnings of parameters' names; 1 where none fits."""
        return {}

    def card(self) -> dict[str, Any]:
        """Return what the model card says of data, split and configuration, as JSON can hold it."""
        return {}

    def tensors(self, network: nn.Module) -> dict[str, Tensor]:
        """Return what the weight file holds."""
        return dict(network.state_dict())

    @classmethod
    def renamed(cls, state: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return our tensors and the network's configuration, of an original implementation's state_dict.

        For `regbench weights import`.

        Raises:
            KeyError: A tensor that every such network has is missing.
            ValueError: It is of no network that is known here; the message says why.
        """
        raise ValueError("no other implementation's names are known")

    def load(self, network: nn.Module, weights: Weights) -> None:
        """Copy a weight file's tensors into the network: the inverse of `tensors`.

        Raises:
            UserError: The weights belong to another model.
        """
        weights.load_into(network)
