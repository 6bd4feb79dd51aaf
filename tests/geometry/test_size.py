import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from regbench.geometry.se3 import se3, transform
from regbench.geometry.size import extent, spacing


@pytest.fixture
def points():
    return np.random.default_rng(0).normal(size=(80, 3)) * (1, 2, 3)


def test_extent_is_the_greatest_distance_from_the_centroid(points):
    assert extent(points) == pytest.approx(cdist(points, points.mean(axis=0, keepdims=True)).max())
    unit = points - points.mean(axis=0)
    assert extent(unit / np.linalg.norm(unit, axis=1).max()) == pytest.approx(1)


def test_spacing_is_the_mean_distance_to_the_nearest_other_point(points):
    distances = cdist(points, points)
    np.fill_diagonal(distances, np.inf)
    assert spacing(points) == pytest.approx(distances.min(axis=1).mean())


@pytest.mark.parametrize("size", [extent, spacing])
def test_sizes_do_not_change_with_motion_and_scale_with_the_cloud(size, points):
    T = se3(Rotation.random(rng=np.random.default_rng(1)).as_matrix(), [5, -7, 9])
    assert size(transform(T, points)) == pytest.approx(size(points))
    assert size(points * 100) == pytest.approx(size(points) * 100)


def test_sizes_of_small_clouds(points):
    assert extent(points[:1]) == 0
    assert spacing(np.zeros((5, 3))) == 0
    with pytest.raises(ValueError, match="without points"):
        extent(points[:0])
    with pytest.raises(ValueError, match="spacing of 1 points"):
        spacing(points[:1])
