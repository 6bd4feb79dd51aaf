"""The compiled ICP step against Kabsch by SVD."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from regbench.geometry.kabsch import kabsch
from regbench.geometry.matches import add_match, fit_matches, moved_point
from regbench.geometry.se3 import se3, transform


def fitted(source, target, matches):
    sums, products = np.zeros((2, 3)), np.zeros((3, 3))
    for index, match in matches:
        add_match(sums, products, source, index, target, match)
    rotation, translation = np.empty((3, 3)), np.empty(3)
    fit_matches(sums, products, len(matches), source, target, rotation, translation)
    return se3(rotation, translation)


def test_it_is_the_motion_of_least_squares_over_the_matches():
    rng = np.random.default_rng(0)
    source, target = rng.normal(size=(40, 3)), rng.normal(size=(30, 3))
    matches = [(index, int(rng.integers(30))) for index in range(2, 40, 2)]
    chosen, partners = (list(part) for part in zip(*matches, strict=True))
    np.testing.assert_allclose(fitted(source, target, matches), kabsch(source[chosen], target[partners]), atol=1e-12)


@pytest.mark.parametrize("offset", [1e3, 1e6])
def test_nothing_is_lost_far_from_the_origin(offset):
    rng = np.random.default_rng(1)
    rotation = Rotation.random(random_state=1).as_matrix()
    source = rng.normal(size=(50, 3)) + offset
    target = (source - offset) @ rotation.T + offset
    found = fitted(source, target, [(index, index) for index in range(50)])
    np.testing.assert_allclose(found[:3, :3], rotation, atol=1e-15 * offset)
    np.testing.assert_allclose(transform(found, source), target, atol=1e-14 * offset)


def test_a_point_is_moved_as_by_the_matrix():
    motion = se3(Rotation.random(random_state=2).as_matrix(), [1.0, -2.0, 3.0])
    points = np.random.default_rng(2).normal(size=(3, 3))
    moved = moved_point(motion[:3, :3].copy(), motion[:3, 3].copy(), points, 1)
    np.testing.assert_allclose(moved, transform(motion, points)[1], atol=1e-15)
