"""The paper's model: encoder, decoder, transformation and evaluation networks together."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from torch import Tensor, nn

from regbench.learning.edge_convolution import Normalisation

from .decoder import FoldingDecoder, MlpDecoder
from .dynamics import EvaluationNetwork, TransformationNetwork, learned_reward
from .encoder import DgcnnEncoder, FoldingEncoder
from .planner import Reward


@dataclass(frozen=True)
class Configuration:
    """What the networks are made by; stored in the model card.

    Attributes:
        encoder: "dgcnn" or "folding" (the paper's Table 2).
        decoder: "folding" or "mlp".
        neighbours: k of DGCNN's graphs.
        normalisation: Of the DGCNN encoder.
        width: Hidden width of f and d.
    """

    encoder: Literal["dgcnn", "folding"] = "dgcnn"
    decoder: Literal["folding", "mlp"] = "folding"
    neighbours: int = 20
    normalisation: Normalisation = "none"
    width: int = 512

    def as_card(self) -> dict[str, Any]:
        """Return the configuration as JSON can hold it."""
        return asdict(self)


class LatentModel(nn.Module):
    """The four networks. Clouds enter centred, in units of the target's extent.

    Args:
        configuration: What to build.
    """

    def __init__(self, configuration: Configuration = Configuration()) -> None:
        super().__init__()
        self.encoder: nn.Module = (
            DgcnnEncoder(k=configuration.neighbours, normalisation=configuration.normalisation)
            if configuration.encoder == "dgcnn"
            else FoldingEncoder()
        )
        self.decoder: nn.Module = FoldingDecoder() if configuration.decoder == "folding" else MlpDecoder()
        self.transformation = TransformationNetwork(width=configuration.width)
        self.evaluation = EvaluationNetwork(width=configuration.width)

    def encode(self, clouds: Tensor) -> Tensor:
        """Map (B, N, 3) clouds to (B, 512) latent states."""
        latents: Tensor = self.encoder(clouds)
        return latents

    def reward(self, source: Tensor, target: Tensor) -> Reward:
        """Return the planner's reward for P pairs of clouds, (P, N, 3) and (P, M, 3)."""
        return learned_reward(self.transformation, self.evaluation, self.encode(source), self.encode(target))
