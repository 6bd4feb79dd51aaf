"""7-Scenes from depth frames, against the formula written out and open3d."""

import shutil

import numpy as np
import pytest
from PIL import Image
from regbench_data_prep.depth import project_depth, project_pixels, valid_pixels
from regbench_data_prep.seven_scenes import prepare
from scipy.spatial import cKDTree

from regbench.datasets.readers.png import read_depth_png
from regbench.datasets.store import open_7scenes, read_manifest
from regbench.errors import UserError
from regbench.native import load_libusb


def run(source, data, **options):
    lines = []
    prepare(source, data, report=lines.append, **options)
    return open_7scenes(data), read_manifest(data / "7scenes"), lines


@pytest.fixture
def stairs(shared_data, tmp_path):
    """Return a writable copy of the sample of stairs."""
    folder = tmp_path / "raw"
    for path in sorted((shared_data / "7scenes" / "stairs").glob("seq-*/*")):
        copy = folder / "stairs" / path.parent.name / path.name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
    return folder


def test_projection_is_the_formula_pixel_by_pixel():
    rng = np.random.default_rng(0)
    depth = rng.integers(0, 65536, (480, 640)).astype(np.uint16)
    depth[rng.random(depth.shape) < 0.3] = 0
    depth[rng.random(depth.shape) < 0.3] = 65535
    v, u = np.nonzero((depth != 0) & (depth != 65535))
    z = depth[v, u] / 1000.0
    expected = np.stack([(u - 320) * z / 585, (v - 240) * z / 585, z], axis=1)
    np.testing.assert_allclose(project_depth(depth), expected, rtol=1e-6, atol=1e-5)
    pixels = np.array([5, 640 * 479 + 639, 1234])
    np.testing.assert_allclose(project_pixels(depth, pixels)[:, 2], depth.ravel()[pixels] / 1000, rtol=1e-6)


def test_both_invalid_values_and_neither_neighbour():
    depth = np.array([[0, 1, 2], [65533, 65534, 65535]], dtype=np.uint16)
    np.testing.assert_array_equal(valid_pixels(depth), [1, 2, 3, 4])


def test_projection_matches_open3d(shared_data):
    load_libusb()
    import open3d as o3d

    depth = read_depth_png(shared_data / "7scenes" / "redkitchen" / "seq-01" / "frame-000000.depth.png")
    camera = o3d.camera.PinholeCameraIntrinsic(640, 480, 585, 585, 320, 240)
    masked = np.where(depth == 65535, 0, depth).astype(np.uint16)
    cloud = o3d.geometry.PointCloud.create_from_depth_image(o3d.geometry.Image(masked), camera, depth_trunc=1000.0)
    np.testing.assert_allclose(project_depth(depth), np.asarray(cloud.points), atol=1e-5)


def test_the_real_sample(stairs, tmp_path):
    dataset, manifest, lines = run(stairs, tmp_path / "data")
    scans = dataset.splits["scans"]
    assert scans.points.shape == (12, 4096, 3)
    assert list(scans.ids[:4]) == [f"stairs/seq-01/frame-00000{i}" for i in (0, 1, 2)] + ["stairs/seq-02/frame-000000"]
    assert list(dataset.label_names) == ["stairs"]
    assert manifest["left_out"] == manifest["remarks"] == {}
    assert lines == ["7scenes: 12 scans of 4096 points, 0 left out"]
    rotations = scans.poses[:, :3, :3]
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (12, 1, 1)), atol=1e-14)
    depth = read_depth_png(stairs / "stairs" / "seq-01" / "frame-000000.depth.png")
    frame = {tuple(point) for point in project_depth(depth)}
    drawn = [tuple(point) for point in scans.points[0]]
    assert set(drawn) <= frame
    assert len(set(drawn)) == len(drawn)
    # In random order: the first and second half cover the frame alike.
    np.testing.assert_allclose(scans.points[0, :2048].mean(axis=0), scans.points[0, 2048:].mean(axis=0), atol=0.05)


def test_poses_bring_neighbouring_frames_together(shared_data, tmp_path):
    """The world's frame: two frames of one sequence agree far better with their poses than without."""
    source = tmp_path / "raw" / "redkitchen" / "seq-01"
    source.mkdir(parents=True)
    for number in (0, 40):
        for suffix in ("depth.png", "pose.txt"):
            name = f"frame-{number:06d}.{suffix}"
            shutil.copyfile(shared_data / "7scenes" / "redkitchen" / "seq-01" / name, source / name)
    dataset, _, _ = run(tmp_path / "raw", tmp_path / "data")
    scans = dataset.splits["scans"]
    first, second = (
        points.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        for points, pose in zip(scans.points, scans.poses, strict=True)
    )
    with_poses = np.median(cKDTree(first).query(second)[0])
    without = np.median(cKDTree(scans.points[0]).query(scans.points[1])[0])
    assert with_poses < 0.03
    assert with_poses < without / 2


def test_twice_and_one_scene_alone(stairs, tmp_path):
    run(stairs, tmp_path / "data")
    deeper = shutil.copytree(stairs, tmp_path / "unpacked" / "archive")  # an archive's own folder
    for source in (stairs / "stairs", deeper.parent):
        _, _, lines = run(source, tmp_path / "data")
        assert lines[-1].endswith("already prepared, nothing changed")


def test_frames_that_cannot_be_used_are_named(stairs, tmp_path):
    folder = stairs / "stairs" / "seq-01"
    content = (folder / "frame-000000.depth.png").read_bytes()
    (folder / "frame-000000.depth.png").write_bytes(content[: len(content) // 2])
    (folder / "frame-000001.pose.txt").unlink()
    (folder / "frame-000002.pose.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0")
    sparse = np.zeros((480, 640), np.uint16)
    sparse[:2] = 1000
    sparse[2:] = 65535
    Image.fromarray(sparse).save(stairs / "stairs" / "seq-02" / "frame-000000.depth.png")
    skewed = np.eye(4)
    skewed[0, 0] = 1.05
    np.savetxt(stairs / "stairs" / "seq-02" / "frame-000001.pose.txt", skewed)
    dataset, manifest, lines = run(stairs, tmp_path / "data")
    left_out = manifest["left_out"]
    assert len(dataset.splits["scans"]) == 8
    assert "frame-000000.depth.png: not a readable PNG image" in left_out["stairs/seq-01/frame-000000"]
    assert left_out["stairs/seq-01/frame-000001"] == "frame-000001.pose.txt: no such file"
    assert "16 numbers, this file has 15" in left_out["stairs/seq-01/frame-000002"]
    assert left_out["stairs/seq-02/frame-000000"] == "only 1280 valid pixels, 4096 wanted"
    assert manifest["remarks"] == {"stairs/seq-02/frame-000001": "its pose was off a rotation by 0.05"}
    assert len(lines) == 6


def test_folders_of_something_else(tmp_path):
    with pytest.raises(UserError, match="no frames found; expected <scene>/seq-XX"):
        run(tmp_path, tmp_path / "data")
    with pytest.raises(UserError, match="no such folder"):
        run(tmp_path / "nowhere", tmp_path / "data")
