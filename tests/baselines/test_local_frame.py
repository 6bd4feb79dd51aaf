import numpy as np
import pytest
from regbench_baselines.local_frame import LocalFrame, require_like_sizes, require_surface
from scipy.spatial.transform import Rotation

from regbench import Problem
from regbench.geometry.se3 import se3, transform
from regbench.geometry.size import extent


@pytest.fixture
def problem():
    rng = np.random.default_rng(0)
    return Problem(source=rng.normal(size=(40, 3)) + (100, 0, 5), target=3 * rng.normal(size=(60, 3)) - (0, 50, 0))


def motion(seed=1):
    rng = np.random.default_rng(seed)
    return se3(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3) * 10)


def test_clouds_are_centred_and_the_target_has_unit_extent(problem):
    frame = LocalFrame.of(problem)
    np.testing.assert_allclose(frame.source.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(frame.target.mean(axis=0), 0, atol=1e-12)
    assert extent(frame.target) == pytest.approx(1)


def test_motions_go_there_and_back(problem):
    frame = LocalFrame.of(problem)
    np.testing.assert_allclose(frame.from_local(frame.to_local(motion())), motion(), atol=1e-10)


def test_a_local_motion_moves_local_points_as_the_motion_moves_the_points(problem):
    frame = LocalFrame.of(problem)
    moved = transform(motion(), problem.source)
    local = transform(frame.to_local(motion()), frame.source)
    np.testing.assert_allclose(local * frame.unit + frame.target_centroid, moved, atol=1e-10)


def test_the_local_identity_matches_centroids(problem):
    T = LocalFrame.of(problem).from_local(np.eye(4))
    np.testing.assert_allclose(transform(T, problem.source).mean(axis=0), problem.target.mean(axis=0), atol=1e-10)


def test_a_target_of_one_point_borrows_the_sources_extent():
    frame = LocalFrame.of(Problem(source=np.eye(3) * 4, target=np.zeros((1, 3))))
    assert frame.unit == pytest.approx(extent(np.eye(3) * 4))
    assert LocalFrame.of(Problem(source=np.zeros((2, 3)), target=np.ones((1, 3)))).unit == 1


def test_a_surface_needs_distinct_points():
    points = np.random.default_rng(0).normal(size=(20, 3))
    require_surface(Problem(source=points, target=points))
    doubled = np.repeat(points[:3], 7, axis=0)
    require_surface(Problem(source=doubled, target=points))
    for bad in (points[:2], np.repeat(points[:2], 7, axis=0), np.ones((9, 3)), points[[0, 1, 1, 1, 0, 1]]):
        with pytest.raises(ValueError, match="the target cloud has fewer than 3 distinct points"):
            require_surface(Problem(source=points, target=bad))


@pytest.mark.parametrize(
    ("source", "target", "words"),
    [
        (1e300, 1.0, "source cloud has coordinates over"),
        (1.0, 1e160, "target cloud has coordinates over"),
        (1.0, 1e-300, "target cloud is smaller than"),
        (1e-160, 1.0, "source cloud is smaller than"),
    ],
)
def test_clouds_whose_squares_are_no_numbers_are_refused(source, target, words):
    with pytest.raises(ValueError, match=words):
        LocalFrame.of(Problem(source=source * np.eye(3), target=target * np.eye(3)))


def test_a_source_a_million_million_times_larger_is_refused_by_searches_in_32_bits():
    require_like_sizes(LocalFrame.of(Problem(source=1e11 * np.eye(3), target=np.eye(3))))
    with pytest.raises(ValueError, match="times as large"):
        require_like_sizes(LocalFrame.of(Problem(source=1e14 * np.eye(3), target=np.eye(3))))
