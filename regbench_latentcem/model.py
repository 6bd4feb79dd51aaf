"""The two models: the paper's four networks together, and the equivariant one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError
from torch import Tensor, nn

from regbench.learning.layers.edge_convolution import Normalisation

from .decoder import FoldingDecoder, MlpDecoder
from .dynamics import EvaluationNetwork, TransformationNetwork, learned_reward
from .encoder import DgcnnEncoder, FoldingEncoder
from .equivariant import VectorEncoder, VectorState, latent_distance_reward
from .pair_evaluation import PairEvaluation
from .planner import Reward

# The middle of the angles of the paper's benchmark, 0 to 45 degrees.
BENCHMARK_MEAN_RAD = math.pi / 8


@dataclass(frozen=True)
class Configuration:
    """What the networks are made by; stored in the model card.

    Attributes:
        encoder: "dgcnn" or "folding" (the paper's Table 2).
        decoder: "folding" or "mlp".
        neighbours: k of DGCNN's graphs.
        normalisation: Of the DGCNN encoder.
        transformation_widths: Of f's hidden layers.
        evaluation_widths: Of d's hidden layers.
        start_rad: Each of the three angles by which a source is turned before it is encoded, if no other start is
            given: the mean of the motions that the model was trained on. Actions are about there.
        action_deviation_rad: The planner's natural spread of the angles: a little more than those motions'. Actions
            enter f in this unit.
        action_deviation_translation: Likewise, of the translation, in extents of the target.
    """

    encoder: Literal["dgcnn", "folding"] = "dgcnn"
    decoder: Literal["folding", "mlp"] = "folding"
    neighbours: int = 20
    normalisation: Normalisation = "none"
    transformation_widths: tuple[int, int] = (1024, 256)
    evaluation_widths: tuple[int, int] = (256, 64)
    start_rad: float = BENCHMARK_MEAN_RAD
    action_deviation_rad: float = 0.25
    action_deviation_translation: float = 0.03
    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    @classmethod
    def from_card(cls, values: Mapping[str, Any]) -> Configuration:
        """Return the configuration that a card holds.

        Raises:
            ValueError: A name is unknown, or a value is not of its type.
        """
        try:
            return TypeAdapter(cls).validate_python(dict(values))
        except ValidationError as error:
            first = error.errors()[0]
            raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None

    def as_card(self) -> dict[str, Any]:
        """Return the configuration as JSON can hold it."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


@dataclass(frozen=True)
class FirstActions:
    """Where the planner's search naturally starts for a model.

    Attributes:
        start_rad: Each of the three angles of the start.
        deviation_rad: sigma_0 of the three angles.
        deviation_translation: sigma_0 of the translation, in extents of the target.
    """

    start_rad: float
    deviation_rad: float
    deviation_translation: float


class LatentModel(nn.Module):
    """The four networks. Clouds enter centred, in units of the target's extent.

    Args:
        configuration: What to build.
    """

    def __init__(self, configuration: Configuration = Configuration()) -> None:
        super().__init__()
        self.configuration = configuration
        self.encoder: nn.Module = (
            DgcnnEncoder(k=configuration.neighbours, normalisation=configuration.normalisation)
            if configuration.encoder == "dgcnn"
            else FoldingEncoder()
        )
        self.decoder: nn.Module = FoldingDecoder() if configuration.decoder == "folding" else MlpDecoder()
        self.transformation = TransformationNetwork(
            widths=configuration.transformation_widths,
            action_deviations=(configuration.action_deviation_rad, configuration.action_deviation_translation),
        )
        self.evaluation = EvaluationNetwork(widths=configuration.evaluation_widths)

    @property
    def first_actions(self) -> FirstActions:
        """Those that the model was trained on."""
        own = self.configuration
        return FirstActions(own.start_rad, own.action_deviation_rad, own.action_deviation_translation)

    def without_decoder(self) -> nn.ModuleDict:
        """Return the networks that registration needs, under their own names."""
        return nn.ModuleDict({name: network for name, network in self.named_children() if name != "decoder"})

    def encode(self, clouds: Tensor) -> Tensor:
        """Map (B, N, 3) clouds to (B, 512) latent states."""
        latents: Tensor = self.encoder(clouds)
        return latents

    def reward(self, z_source: Tensor, z_target: Tensor) -> Reward:
        """Return the planner's reward for P pairs of latent states, (P, 512) each."""
        return learned_reward(self.transformation, self.evaluation, z_source, z_target)


class EquivariantModel(nn.Module):
    """Vectors that turn with the cloud; the transformation network is the rotation itself. Works in float64.

    Clouds enter centred, in units of the target's extent. f is exact for every action, so that the search starts at
    none and as wide as CEMNet's, the next paper of LatentCEM's first author.

    Args:
        encoder: Untrained as it is built.
        evaluation: Learned d; without it, d is the squared distance of the latent states.
    """

    def __init__(self, encoder: VectorEncoder, evaluation: PairEvaluation | None = None) -> None:
        super().__init__()
        self.encoder = encoder
        self.evaluation = evaluation
        self.first_actions = FirstActions(0.0, 1.0, 0.5)

    def encode(self, clouds: Tensor) -> VectorState:
        """Map (B, N, 3) float64 clouds to their latent states."""
        state: VectorState = self.encoder(clouds)
        return state

    def reward(self, z_source: VectorState, z_target: VectorState) -> Reward:
        """Return the planner's reward for P pairs of latent states."""
        if self.evaluation is None:
            return latent_distance_reward(z_source, z_target)
        return self.evaluation.reward(z_source, z_target)
