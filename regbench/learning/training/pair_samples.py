"""Training pairs, made as the protocols make theirs: a cloud, its moved copy, and the motion between them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regbench.contract import Problem
from regbench.geometry.local_frame import LocalFrame
from regbench.geometry.se3 import invert, se3, transform
from regbench.protocols.draws import DCP_PRIOR, draw_motion
from regbench.protocols.moved_copy import Clouds, copied, cropped, resampled

Cloud = NDArray[np.float64]
Kind = Literal["clean", "noise", "resampled", "partial"]
Motions = Literal["benchmark", "about_mean", "twist"]

# Share of the points that a crop keeps (modelnet40/partial@1).
KEPT = 0.7
TRANSLATION = 0.5


def draw_pair(
    cloud: Cloud, points: int, kind: Kind, motions: Motions, most_rad: float, rng: np.random.Generator
) -> dict[str, NDArray[np.float32]]:
    """Return a pair as a network sees it: about the clouds' centroids, in extents of the target.

    Args:
        cloud: (P, 3), P >= points.
        points: Points of the shape that the pair is made from: each cloud has so many; half, where kind is
            "resampled"; 70 %, where it is "partial".
        kind: As the protocols of that name.
        motions: "benchmark", the protocols'; "about_mean", the same after the source was turned by their mean rotation;
            "twist", rotations about a random axis by up to `most_rad`.
        most_rad: Largest angle of "twist".
        rng: The sample's own.

    Returns:
        float32: "source" (N, 3), "target" (N, 3) and "T_target_source" (4, 4).
    """
    shape = cloud[rng.permutation(len(cloud))[:points]]
    T = _motion(motions, most_rad, rng)
    # A name of its own seeds whatever the protocols' functions draw.
    made = _made(shape, T, kind, f"training {rng.integers(2**63)}")
    frame = LocalFrame.of(Problem(source=made.source, target=made.target))
    start = DCP_PRIOR.mean_T_target_source() if motions == "about_mean" else np.eye(4)
    start[:3, 3] = 0.0
    pair = {
        "source": transform(start, frame.source),
        "target": frame.target,
        "T_target_source": frame.to_local(T) @ invert(start),
    }
    return {name: values.astype(np.float32) for name, values in pair.items()}


def _motion(motions: Motions, most_rad: float, rng: np.random.Generator) -> Cloud:
    if motions != "twist":
        return draw_motion(DCP_PRIOR, rng)
    axis = rng.normal(size=3)
    rotation = Rotation.from_rotvec(axis / np.linalg.norm(axis) * rng.uniform(0, most_rad)).as_matrix()
    return se3(rotation, rng.uniform(-TRANSLATION, TRANSLATION, 3))


def _made(shape: Cloud, T: Cloud, kind: Kind, seed: str) -> Clouds:
    if kind == "resampled":
        return resampled(shape, T, seed, 0, len(shape) // 2)
    if kind == "partial":
        return cropped(shape, T, seed, 0, KEPT)
    return copied(shape, T, seed, 0, "both" if kind == "noise" else "none")
