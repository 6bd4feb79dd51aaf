"""Problems made by moving a copy of one cloud: DCP's base protocol and the kinds of it that papers use.

The order in which DCP draws is kept within the motion (angles x, y, z, then tx, ty, tz); permutations, noise, crops
and the split of a resampled shape have streams of their own (see draws.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from regbench.contract import MotionPrior
from regbench.geometry.se3 import transform
from regbench.protocols.draws import DCP_PRIOR, draw_motion, draw_noise, generator
from regbench.protocols.protocol import Pair, ProblemSet

Cloud = NDArray[np.float64]
Noise = Literal["none", "both", "shared"]


@dataclass(frozen=True)
class Clouds:
    """The two clouds of one problem, and what they are without noise or crops."""

    source: Cloud
    target: Cloud
    clean_source: Cloud
    clean_target: Cloud


def copied(cloud: Cloud, T: Cloud, protocol: str, index: int, noise: Noise) -> Clouds:
    """Return the cloud and its moved copy, each permuted on its own.

    Noise "both" is drawn for each cloud after its permutation (PRNet, CEMNet); "shared" is drawn once, before the
    copy is made (DCP).
    """
    noisy = cloud + draw_noise(cloud.shape, generator(protocol, index, "noise")) if noise == "shared" else cloud
    moved_clean = transform(T, cloud)
    source = _permuted(noisy, protocol, index, "permutation of source")
    target = _permuted(
        transform(T, noisy) if noise == "shared" else moved_clean, protocol, index, "permutation of target"
    )
    if noise == "both":
        source += draw_noise(source.shape, generator(protocol, index, "noise of source"))
        target += draw_noise(target.shape, generator(protocol, index, "noise of target"))
    return Clouds(source, target, cloud, moved_clean)


def resampled(cloud: Cloud, T: Cloud, protocol: str, index: int, points: int) -> Clouds:
    """Return two clouds of `points` points each that share none, from one shape of at least 2 * `points`."""
    order = generator(protocol, index, "split of the shape").permutation(len(cloud))
    source, target = cloud[order[:points]], transform(T, cloud[order[points : 2 * points]])
    return Clouds(source, target, cloud, transform(T, cloud))


def cropped(cloud: Cloud, T: Cloud, protocol: str, index: int, keep: float) -> Clouds:
    """Return two clouds, each cut by its own random half-space to a share `keep` of its points, permuted, noisy.

    RPM-Net's: the plane's normal is uniform on the sphere, and of the points, sorted by signed distance from the
    plane through the centroid, the farthest are kept. 70 % of 1,024 are the 717 points that RPM-Net draws.
    """

    def cut(points: Cloud, which: str) -> Cloud:
        normal = generator(protocol, index, f"crop of {which}").normal(size=3)
        distance = (points - points.mean(axis=0)) @ normal
        kept = points[np.argsort(-distance, kind="stable")[: round(keep * len(points))]]
        kept = _permuted(kept, protocol, index, f"permutation of {which}")
        return kept + draw_noise(kept.shape, generator(protocol, index, f"noise of {which}"))

    moved = transform(T, cloud)
    return Clouds(cut(cloud, "source"), cut(moved, "target"), cloud, moved)


def _permuted(points: Cloud, protocol: str, index: int, what: str) -> Cloud:
    return points.take(generator(protocol, index, what).permutation(len(points)), axis=0)


class MovedCopies(ProblemSet):
    """Problems made from one cloud each, by a drawn motion.

    Args:
        protocol: Protocol id, from which every draw is seeded.
        clouds: Returns the (P, 3) float64 cloud of a problem.
        labels: Category of each problem.
        ids: Name of the shape of each problem.
        make: Makes the two clouds from (cloud, T_target_source, protocol, index).
        data_sha256: Identity of the dataset.
        prior: Range of the motions, disclosed to methods.
    """

    def __init__(
        self,
        *,
        protocol: str,
        clouds: Callable[[int], Cloud],
        labels: Sequence[str],
        ids: Sequence[str],
        make: Callable[[Cloud, Cloud, str, int], Clouds],
        data_sha256: str,
        prior: MotionPrior = DCP_PRIOR,
    ) -> None:
        self.protocol = protocol
        self.motion_prior = prior
        self.data_sha256 = data_sha256
        self._clouds, self._labels, self._ids, self._make = clouds, labels, ids, make

    def __len__(self) -> int:
        return len(self._ids)

    def pair(self, index: int) -> Pair:
        """Return problem `index` with its answer."""
        assert self.motion_prior is not None
        T = draw_motion(self.motion_prior, generator(self.protocol, index, "motion"))
        made = self._make(self._clouds(index), T, self.protocol, index)
        return Pair(
            source=made.source,
            target=made.target,
            T_target_source=T,
            label=self._labels[index],
            id=self._ids[index],
            clean_source=made.clean_source,
            clean_target=made.clean_target,
        )
