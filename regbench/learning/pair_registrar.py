"""A learned method that aligns two clouds at once: weights, frame and device, for all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem, Registrar, Registration
from regbench.geometry.local_frame import LocalFrame
from regbench.geometry.se3 import nearest_rigid, transform
from regbench.geometry.starts import Start, skip_without_prior, start_of
from regbench.geometry.thinning import drawn
from regbench.learning.training_words import training_words
from regbench.learning.weight_files import WeightFiles

if TYPE_CHECKING:
    from regbench.learning.pair_network import PairNetwork


@dataclass(frozen=True, eq=False)
class _Local:
    """A problem as a network sees it: the frame, the start in it, and the clouds, (N, 3) and (M, 3)."""

    frame: LocalFrame
    start: NDArray[np.float64]
    source: NDArray[np.float64]
    target: NDArray[np.float64]


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
        return self.register_batch([problem])[0]

    def register_batch(self, problems: Sequence[Problem]) -> list[Registration]:
        """Estimate T_target_source of several problems; those with clouds of the same sizes go through at once.

        Raises:
            ValueError: A cloud has no points.
            UserError: As `prepare`.
        """
        import torch

        if self._network is None:
            self.prepare()
        assert self._network is not None
        asked = [self._local(problem) for problem in problems]
        by_sizes: dict[tuple[int, int], list[int]] = {}
        for place, local in enumerate(asked):
            by_sizes.setdefault((len(local.source), len(local.target)), []).append(place)
        answers: dict[int, Registration] = {}
        for places in by_sizes.values():
            device = problems[places[0]].device
            stacked = (np.stack([getattr(asked[place], cloud) for place in places]) for cloud in ("source", "target"))
            source, target = (torch.tensor(clouds, dtype=torch.float32, device=device) for clouds in stacked)
            with torch.inference_mode():
                found = self._network.to(device).align(source, target, **self.options())
            motions = found.T_target_source.double().cpu().numpy()
            for number, place in enumerate(places):
                local = asked[place]
                # Float32 rotations are orthonormal to six digits.
                answers[place] = Registration(
                    T_target_source=local.frame.from_local(nearest_rigid(motions[number]) @ local.start),
                    iterations=found.iterations,
                    confidence=None if found.confidence is None else float(found.confidence[number]),
                )
        return [answers[place] for place in range(len(problems))]

    def _local(self, problem: Problem) -> _Local:
        frame = LocalFrame.of(problem)
        start = start_of(problem, frame, self.init)
        rng = np.random.default_rng(problem.seed)
        clouds = (transform(start, frame.source), frame.target)
        return _Local(frame, start, *(drawn(cloud, self.max_points, rng) for cloud in clouds))
