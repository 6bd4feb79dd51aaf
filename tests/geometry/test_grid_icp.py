"""ICP on a distance grid: near exact ICP, in SE(3), and trimmed where asked."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from regbench.geometry.distance_grid import DistanceGrid
from regbench.geometry.grid_icp import grid_icp
from regbench.geometry.icp import icp
from regbench.geometry.se3 import se3, transform
from regbench.testing.clouds import body

TRUTH = se3(Rotation.from_rotvec([0.1, -0.2, 0.1]).as_matrix(), np.array([0.02, -0.03, 0.05]))


def run(source, target, kept=None, iterations=50):
    grid = DistanceGrid.of(target, cells=64)
    rotation, translation = np.eye(3), np.zeros(3)
    error = grid_icp(
        source.astype(np.float32),
        grid.points,
        grid.labels,
        grid.low,
        grid.cell,
        grid.shape,
        rotation,
        translation,
        kept or len(source),
        iterations,
        0.0,
    )
    return se3(rotation, translation), error


def test_it_ends_near_exact_icp():
    source = body(500)
    target = transform(TRUTH, np.random.default_rng(0).permutation(source))
    found, error = run(source, target)
    exact = icp(source, target, np.eye(4))
    np.testing.assert_allclose(exact.T_target_source, TRUTH, atol=1e-6)
    np.testing.assert_allclose(found, TRUTH, atol=0.02)
    assert error < 0.05**2


def test_it_does_iterate_and_the_error_falls():
    source = body(500)
    target = transform(TRUTH, source)
    errors = [run(source, target, iterations=count)[1] for count in (1, 2, 4, 8)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.5 * errors[0]


def test_trimming_ignores_what_has_no_partner():
    source = body(400)
    target = transform(TRUTH, source)
    cluttered = np.concatenate([source, source[:100] * 0.2 + [1.5, 1.5, 0]])
    trimmed, _ = run(cluttered, target, kept=380)
    np.testing.assert_allclose(trimmed, TRUTH, atol=0.03)
    everything, _ = run(cluttered, target)
    assert np.abs(everything - TRUTH).max() > 0.1


@pytest.mark.parametrize("points", [np.zeros((5, 3)), np.outer(np.arange(5.0), [1, 0, 0]), body(60)[:1]])
def test_degenerate_clouds_get_a_motion(points):
    found, _ = run(points, points)
    np.testing.assert_allclose(found[:3, :3] @ found[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.isfinite(found).all()
