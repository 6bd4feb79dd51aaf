"""cad_demo: what DESIGN promises of it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench.datasets.cad_demo import open_dataset

# Changes only with the shapes, and then with the version of every protocol on them.
SHA256 = "64de65f53f73b3707b19208355a8fe1dff263b46515e01126d22a82e72da5fbf"


@pytest.fixture(scope="module")
def dataset():
    return open_dataset(Path("unused"))


def test_shapes(dataset):
    test = dataset.splits["test"]
    assert test.points.shape == (224, 1024, 3)
    assert dataset.splits["train"].points.shape == (112, 1024, 3)
    assert len(dataset.label_names) == 14
    for split in dataset.splits.values():
        assert split.points.dtype == np.float32
        assert not split.points.flags.writeable
        np.testing.assert_allclose(split.points.mean(axis=1), 0, atol=2e-5)
        np.testing.assert_allclose(np.linalg.norm(split.points, axis=2).max(axis=1), 1, atol=2e-5)
        for label, shape_id in zip(split.labels, split.ids, strict=True):
            assert shape_id.startswith(dataset.label_names[label] + "/")
    ids = [shape_id for split in dataset.splits.values() for shape_id in split.ids]
    assert len(set(ids)) == len(ids) == 336


def test_the_same_bits_in_another_process(dataset):
    code = (
        "from regbench.datasets.cad_demo import open_dataset; from pathlib import Path; "
        "print(open_dataset(Path()).sha256)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == dataset.sha256 == SHA256


def test_shapes_vary_within_a_category(dataset):
    test = dataset.splits["test"]
    spreads = np.sort(test.points.std(axis=1), axis=1)
    for label in range(14):
        assert np.ptp(spreads[test.labels == label], axis=0).max() > 0.01, dataset.label_names[label]


def test_the_first_points_are_a_fair_subset(dataset):
    points = dataset.splits["test"].points
    np.testing.assert_allclose(points[:, :512].mean(axis=1), points[:, 512:].mean(axis=1), atol=0.15)


def test_most_shapes_have_one_pose_only(dataset):
    """Turned about its own axes a shape does not fall onto itself: nearest points are farther than the spacing."""
    turns = [Rotation.from_rotvec(axis * angle) for axis in np.eye(3) for angle in np.radians((30, 60, 90, 120, 180))]
    worst = []
    for points in dataset.splits["test"].points.astype(np.float64)[::4]:
        tree = cKDTree(points)
        spacing = tree.query(points, k=2)[0][:, 1].mean()
        worst.append(min(tree.query(turn.apply(points))[0].mean() / spacing for turn in turns))
    # Two independent draws of one surface are about one spacing apart.
    assert np.mean(np.array(worst) > 1.3) > 0.85
