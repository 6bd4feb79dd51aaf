"""Problems on real shapes and scans, made as the protocols make them, but written independently of them."""

from pathlib import Path

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from regbench import MotionPrior, Problem

PRIOR = MotionPrior((0.0,) * 3, (45.0,) * 3, (-0.5,) * 3, (0.5,) * 3)


def modelnet40_shapes(shared_data: Path, count: int):
    """The first test shapes of the pack, every 50th: varied categories."""
    with h5py.File(shared_data / "modelnet40_ply_hdf5_1024" / "ply_data_test0.h5") as file:
        return file["data"][: 50 * count : 50].astype(np.float64)


def clean_pair(shape, seed, noise=False):
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0, 45, 3)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("zyx", angles[::-1], degrees=True).as_matrix()
    T[:3, 3] = rng.uniform(-0.5, 0.5, 3)
    source = shape[:784]
    target = source @ T[:3, :3].T + T[:3, 3]
    source, target = rng.permutation(source), rng.permutation(target)
    if noise:
        source, target = (x + np.clip(rng.normal(0, 0.01, x.shape), -0.05, 0.05) for x in (source, target))
    return Problem(source=source, target=target, motion_prior=PRIOR, seed=seed), T


def rotation_error_deg(T, truth):
    return np.degrees(Rotation.from_matrix(truth[:3, :3].T @ T[:3, :3]).magnitude())


def translation_error(T, truth):
    return np.linalg.norm((np.linalg.inv(truth) @ T)[:3, 3])
