"""Errors that look at the clouds: they do not punish a motion that a symmetric shape cannot tell from the truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from regbench.geometry.se3 import invert, transform

Array = NDArray[np.float64]


def symmetry_aware_error(T_estimates: ArrayLike, T_truth: ArrayLike, source: ArrayLike) -> Array:
    """Return the mean distance from each source point moved by the estimate to the cloud moved by the truth.

    mean over p of min over q of |T_estimate p - T_truth q|, with p and q source points (ADD-S of Hinterstoisser et
    al. 2012, in the form of Xiang et al. 2018). It is 0 for the truth and for every symmetry of the cloud.

    Args:
        T_estimates: (n, 4, 4) estimates of T_target_source for one problem.
        T_truth: (4, 4) ground truth.
        source: (N, 3) points.

    Returns:
        (n,) float64 in the clouds' unit.
    """
    points = _points("source", source)
    tree = cKDTree(points)
    to_source = invert(T_truth)  # distances are measured in the source's frame: one tree for every estimate
    moved = [transform(to_source @ T, points) for T in np.asarray(T_estimates, dtype=np.float64)]
    return np.array([_distances(tree, cloud).mean() for cloud in moved], dtype=np.float64)


def modified_chamfer(
    T_estimates: ArrayLike, source: ArrayLike, target: ArrayLike, clean_source: ArrayLike, clean_target: ArrayLike
) -> Array:
    """Return RPM-Net's modified Chamfer distance (Yew and Lee 2020): squared, against clean clouds.

    mean over p in source of min over q in clean_target of |T p - q|^2, plus mean over q in target of min over p in
    clean_source of |q - T p|^2.

    Args:
        T_estimates: (n, 4, 4) estimates of T_target_source for one problem.
        source: (N, 3) points as the method saw them.
        target: (M, 3) points as the method saw them.
        clean_source: (N', 3) whole cloud without noise, in the source's frame.
        clean_target: (M', 3) likewise, in the target's frame.

    Returns:
        (n,) float64 in the clouds' unit, squared.
    """
    source_points, target_points = _points("source", source), _points("target", target)
    target_tree = cKDTree(_points("clean_target", clean_target))
    source_tree = cKDTree(_points("clean_source", clean_source))
    return np.array(
        [
            (_distances(target_tree, transform(T, source_points)) ** 2).mean()
            + (_distances(source_tree, transform(invert(T), target_points)) ** 2).mean()
            for T in np.asarray(T_estimates, dtype=np.float64)
        ],
        dtype=np.float64,
    )


def _distances(tree: cKDTree, points: Array) -> Array:
    """Return the distance from each of (N, 3) points to the nearest point of a tree, (N,)."""
    return np.asarray(tree.query(points)[0], dtype=np.float64)


def _points(name: str, values: ArrayLike) -> Array:
    points = np.asarray(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise ValueError(f"{name} must have shape (N, 3) with N >= 1, got {points.shape}")
    return points
