import numpy as np
import pytest

from regbench.geometry.spread import spread_order


def test_each_point_is_the_farthest_from_those_before():
    points = np.random.default_rng(0).normal(size=(120, 3))
    order = spread_order(points, 120)
    assert sorted(order) == list(range(120))
    assert order[0] == np.argmax(np.linalg.norm(points, axis=1))
    for place in range(1, 120):
        gaps = np.linalg.norm(points[:, None] - points[order[:place]], axis=2).min(axis=1)
        assert gaps[order[place]] == pytest.approx(gaps.max())


def test_points_that_repeat_come_last_and_once_each():
    points = np.repeat(np.random.default_rng(0).normal(size=(4, 3)), 3, axis=0)
    order = spread_order(points, 12)
    assert sorted(order) == list(range(12))
    assert len({tuple(points[index]) for index in order[:4]}) == 4
