"""What a network answers that aligns two clouds at once."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

from torch import Tensor, nn


@dataclass(frozen=True, eq=False)
class Alignment:
    """A batch of answers.

    Attributes:
        T_target_source: (B, 4, 4).
        iterations: Of the method, or None where that means nothing.
        confidence: (B,), the method's own score, or None.
    """

    T_target_source: Tensor
    iterations: int | None = None
    confidence: Tensor | None = None


class PairNetwork(nn.Module):
    """A network that takes two clouds about their centroids, in extents of the target, and answers a motion."""

    @abstractmethod
    def align(self, source: Tensor, target: Tensor, **options: Any) -> Alignment:
        """Return the motions of a batch.

        Args:
            source: (B, N, 3) float32.
            target: (B, M, 3) float32.
            options: What a registrar lets its user choose, such as `iterations`.
        """
