"""A learned method that aligns two clouds at once: weights, frame and device, for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.local_frame import LocalFrame
from regbench.geometry.se3 import nearest_rigid, transform
from regbench.geometry.starts import Start, skip_without_prior, start_of
from regbench.geometry.thinning import drawn
from regbench.learning.training_words import training_words
from regbench.learning.weight_files import WeightFiles

if TYPE_CHECKING:
    from regbench.learning.pair_network import PairNetwork


class PairRegistrar(Registrar):
    """The part of a learned method that all have in common. Loads no torch before `prepare`.

    A method says where its weights are, builds its network, and stores `weights`, `init` and `max_points`, which every
    constructor has, besides its own arguments:

        weights: Name of the weights in this package, or a path that ends in .safetensors.
        init: The motion that the source is moved by first: "centroid", "identity", or "prior", the protocol's mean
            rotation. A start given by the problem replaces the first two.
        max_points: Points of each cloud that the network sees, at most; of larger clouds so many are drawn at random.

    Attributes:
        files: Its weight files.
    """

    kind = "learned"
    requires = ("torch", "safetensors")
    files: ClassVar[WeightFiles]
    weights: str
    init: Start
    max_points: int
    _network: PairNetwork | None = None

    def build(self, configuration: Mapping[str, Any]) -> PairNetwork:
        """Return the network that a model card's "configuration" describes.

        Raises:
            TypeError: It describes another one.
        """
        raise NotImplementedError

    def options(self) -> dict[str, Any]:
        """Return the options of the network's `align`."""
        return {}

    def prepare(self) -> None:
        """Load the network.

        Raises:
            UserError: The weights are missing, damaged, or of another model.
        """
        from regbench.errors import UserError
        from regbench.learning.weights import load_weights

        path = self.files.path(self.weights)
        weights = load_weights(path)
        try:
            network = self.build(weights.card["configuration"])
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(f"weights {path}: the model card's 'configuration' is not {self.name}'s: {error}") from None
        weights.load_into(network)
        self._network = network.eval().requires_grad_(False)

    def skip(self, problem: Problem) -> str | None:
        """Decline problems without a motion prior if the start is taken from it."""
        return skip_without_prior(problem, self.init)

    def data_files(self) -> list[Path]:
        """Return the weight file in use."""
        return [self.files.file(self.weights)]

    def training(self) -> str | None:
        """Return what the weights' card says of their training."""
        return training_words(self.files.file(self.weights))

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud has no points.
            UserError: As `prepare`.
        """
        import torch

        if self._network is None:
            self.prepare()
        assert self._network is not None
        network = self._network.to(problem.device)
        frame = LocalFrame.of(problem)
        start = start_of(problem, frame, self.init)
        rng = np.random.default_rng(problem.seed)
        clouds = (drawn(cloud, self.max_points, rng) for cloud in (transform(start, frame.source), frame.target))
        source, target = (torch.tensor(cloud, dtype=torch.float32, device=problem.device)[None] for cloud in clouds)
        with torch.inference_mode():
            found = network.align(source, target, **self.options())
        # Float32 rotations are orthonormal to six digits.
        T_local = nearest_rigid(found.T_target_source[0].double().cpu().numpy()) @ start
        return Registration(
            T_target_source=frame.from_local(T_local),
            iterations=found.iterations,
            confidence=None if found.confidence is None else float(found.confidence[0]),
        )
