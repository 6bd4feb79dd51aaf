"""The best motions met so far, each kept once, with how many bases found it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# The least of what is met is forgotten.
MOST = 64


@dataclass(eq=False)
class Candidate:
    """A motion.

    Attributes:
        motion: (3, 4) float64.
        score: See verification.py.
        place: (12,) float64, see `Places`.
        bases: How many bases found it.
    """

    motion: NDArray[np.float64]
    score: float
    place: NDArray[np.float64]
    bases: int = 1


class Places:
    """Motions as places in a space where distance is displacement.

    The distance between two motions' places is how far apart they put the points of a cloud, as a root mean square.
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        self._mean = points.mean(axis=0)
        offsets = points - self._mean
        values, vectors = np.linalg.eigh(offsets.T @ offsets / len(points))
        self._spread = vectors * np.sqrt(np.maximum(values, 0.0))

    def of(self, motions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the places, (S, 12) float64, of (S, 3, 4) motions."""
        turned = motions[:, :, :3] @ self._spread
        return np.concatenate([turned.reshape(-1, 9), motions[:, :, :3] @ self._mean + motions[:, :, 3]], axis=1)


def distinct(places: NDArray[np.float64], radius: float, most: int) -> NDArray[np.int64]:
    """Return indices of places that are the first within a radius of themselves, at most so many.

    Args:
        places: (S, 12) float64, best first.
        radius: Of what counts as the same.
        most: Most indices.
    """
    free = np.ones(len(places), np.bool_)
    chosen: list[int] = []
    while len(chosen) < most and free.any():
        first = int(np.argmax(free))
        chosen.append(first)
        free &= ((places - places[first]) ** 2).sum(axis=1) > radius**2
    return np.array(chosen, dtype=np.int64)


class Candidates:
    """Motions met by several bases, best first.

    Args:
        radius: Motions that put the points so near to each other, as a root mean square, are the same.
    """

    def __init__(self, radius: float) -> None:
        self._radius = radius
        self._all: list[Candidate] = []

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)

    @property
    def best(self) -> Candidate:
        """The one of the highest score."""
        return self._all[0]

    def add(self, motions: NDArray[np.float64], scores: NDArray[np.float64], places: NDArray[np.float64]) -> None:
        """Add what one base found: (S, 3, 4) motions, (S,) scores, (S, 12) places."""
        found: set[int] = set()
        for index in np.argsort(-scores, kind="stable"):
            new = Candidate(motions[index], float(scores[index]), places[index])
            known = self._near(new)
            if known is None:
                self._all.append(new)
                found.add(id(new))
                continue
            if id(known) not in found:
                known.bases += 1
                found.add(id(known))
            if new.score > known.score:
                known.motion, known.score, known.place = new.motion, new.score, new.place
        self._all.sort(key=lambda candidate: -candidate.score)
        del self._all[MOST:]

    def _near(self, new: Candidate) -> Candidate | None:
        for known in self._all:
            if ((known.place - new.place) ** 2).sum() <= self._radius**2:
                return known
        return None
