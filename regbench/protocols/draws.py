"""Random draws of protocols: each from a seed derived from (protocol, problem index, what is drawn)."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from regbench.contract import MotionPrior
from regbench.geometry.se3 import rotation_from_euler_deg, se3

NOISE_SIGMA = 0.01
NOISE_CLIP = 0.05

# DCP's motions: three positive angles and a translation per axis.
DCP_PRIOR = MotionPrior((0.0,) * 3, (45.0,) * 3, (-0.5,) * 3, (0.5,) * 3)


def derive_seed(protocol: str, index: int, what: str) -> int:
    """Return a 64-bit seed that depends on nothing else, on any machine."""
    return int.from_bytes(hashlib.sha256(f"{protocol}|{index}|{what}".encode()).digest()[:8], "little")


def generator(protocol: str, index: int, what: str) -> np.random.Generator:
    """Return a generator for one draw. PCG64 is named, so that a change of NumPy's default cannot change problems."""
    return np.random.Generator(np.random.PCG64(derive_seed(protocol, index, what)))


def draw_motion(prior: MotionPrior, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw a (4, 4) T_target_source uniformly in the prior's ranges: angles x, y, z, then tx, ty, tz."""
    ranges = zip(prior.angle_min_deg + prior.translation_min, prior.angle_max_deg + prior.translation_max, strict=True)
    draws = [rng.uniform(least, greatest) for least, greatest in ranges]
    angles_deg, translation = draws[:3], draws[3:]
    return se3(rotation_from_euler_deg(angles_deg), translation)


def draw_noise(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw Gaussian noise of standard deviation 0.01, clipped at 0.05 (PRNet, RPM-Net)."""
    noise = rng.normal(0.0, NOISE_SIGMA, shape)
    return np.clip(noise, -NOISE_CLIP, NOISE_CLIP, out=noise)
