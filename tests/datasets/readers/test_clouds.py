"""Readers of clouds against open3d and trimesh, on real files and on written ones."""

import numpy as np
import pytest

from regbench.datasets.readers.cloud import check_writable, read_cloud, write_cloud
from regbench.datasets.readers.off import read_off
from regbench.datasets.readers.pcd import read_pcd
from regbench.datasets.readers.ply import read_ply
from regbench.errors import UserError
from regbench.native import load_libusb


@pytest.fixture(scope="module")
def o3d():
    load_libusb()
    import open3d

    return open3d


@pytest.fixture
def points():
    return np.random.default_rng(0).normal(size=(500, 3))


@pytest.mark.parametrize(
    "file",
    ["bunny/bun000.ply", "bunny/bun315.ply", "kitti/source.ply", "3dmatch_redkitchen/cloud_bin_0.ply"],
)
def test_real_ply_files_match_open3d(shared_data, o3d, file):
    path = shared_data / "extras" / file
    expected = np.asarray(o3d.io.read_point_cloud(str(path)).points)
    # open3d parses text as float32 where the file says float.
    np.testing.assert_allclose(read_cloud(path), expected, rtol=1e-6, atol=1e-9)


def test_real_off_files_match_trimesh(shared_data):
    import trimesh

    paths = sorted((shared_data / "modelnet40_off_sample").rglob("*.off"))
    assert len(paths) == 12
    for path in paths:
        mesh = read_off(path)
        expected = trimesh.load(path, process=False)
        np.testing.assert_allclose(mesh.vertices, expected.vertices, atol=1e-9, err_msg=path.name)
        assert len(mesh.faces) == len(expected.faces), path.name
        np.testing.assert_allclose(
            np.sort(mesh.vertices[mesh.faces].reshape(-1, 9).sum(axis=1)),
            np.sort(np.asarray(expected.triangles).reshape(-1, 9).sum(axis=1)),
            atol=1e-6,
            err_msg=path.name,
        )


@pytest.mark.parametrize("mode", ["ascii", "binary", "compressed"])
def test_pcd_written_by_open3d(tmp_path, o3d, points, mode):
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.round(2)))
    cloud.colors = o3d.utility.Vector3dVector(np.zeros_like(points))
    cloud.normals = o3d.utility.Vector3dVector(np.tile([0.0, 0, 1], (len(points), 1)))
    path = tmp_path / "cloud.pcd"
    o3d.io.write_point_cloud(str(path), cloud, write_ascii=mode == "ascii", compressed=mode == "compressed")
    assert f"DATA {mode}".encode() in path.read_bytes().replace(b"binary_compressed", b"compressed")
    np.testing.assert_allclose(read_cloud(path), np.asarray(o3d.io.read_point_cloud(str(path)).points), atol=1e-12)
    np.testing.assert_allclose(read_cloud(path), points.round(2), atol=1e-6)


@pytest.mark.parametrize("ascii_", [True, False])
def test_ply_written_by_open3d(tmp_path, o3d, points, ascii_):
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.colors = o3d.utility.Vector3dVector(np.zeros_like(points))
    path = tmp_path / "cloud.ply"
    o3d.io.write_point_cloud(str(path), cloud, write_ascii=ascii_)
    np.testing.assert_allclose(read_cloud(path), points, rtol=1e-5)  # open3d writes six digits as text


@pytest.mark.parametrize("suffix", [".ply", ".npy", ".xyz", ".txt"])
def test_what_is_written_reads_back_bit_for_bit(tmp_path, points, suffix):
    path = tmp_path / f"cloud{suffix}"
    write_cloud(path, points)
    np.testing.assert_array_equal(read_cloud(path), points)
    assert [item.name for item in tmp_path.iterdir()] == [path.name]


def test_written_ply_is_read_by_open3d(tmp_path, o3d, points):
    write_cloud(tmp_path / "cloud.ply", points)
    cloud = o3d.io.read_point_cloud(str(tmp_path / "cloud.ply"))
    np.testing.assert_array_equal(np.asarray(cloud.points), points)


def test_big_endian_ply_with_elements_around_the_vertices(tmp_path):
    expected = np.arange(12.0).reshape(4, 3)
    vertices = np.zeros(4, [("x", ">f8"), ("flag", ">u1"), ("y", ">f8"), ("z", ">f4")])
    vertices["x"], vertices["y"], vertices["z"] = expected.T
    header = (
        "ply\r\nformat binary_big_endian 1.0\r\ncomment by hand\r\nobj_info none\r\n"
        "element camera 2\r\nproperty short a\r\nproperty double b\r\n"
        "element vertex 4\r\nproperty double x\r\nproperty uchar flag\r\nproperty double y\r\nproperty float z\r\n"
        "element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
    )
    path = tmp_path / "big.ply"
    path.write_bytes(header.encode() + b"\1" * 20 + vertices.tobytes() + b"\3" + b"\0" * 12)
    np.testing.assert_array_equal(read_cloud(path), expected)


@pytest.mark.parametrize(
    ("text", "faces"),
    [
        ("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", [[0, 1, 2], [0, 2, 3]]),
        ("OFF4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n", [[0, 1, 2], [0, 2, 3]]),
        ("# made\nOFF # here\n4 1\n0 0 0\n1 0 0 # b\n\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n", [[0, 1, 2]]),
        ("OFF\r\n4 2 0\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n2 0 1\r\n3 0 2 3\r\n", [[0, 2, 3]]),
        ("OFF 4 0 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n", np.empty((0, 3))),
    ],
)
def test_off_headers_polygons_comments_and_colours(tmp_path, text, faces):
    path = tmp_path / "mesh.off"
    path.write_bytes(text.encode())
    mesh = read_off(path)
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(mesh.faces, faces)


def test_xyz_with_comments_commas_and_further_columns(tmp_path):
    (tmp_path / "cloud.xyz").write_text("# x y z i\n1, 2, 3, 9\n\n4 5 6 9\n")
    np.testing.assert_array_equal(read_cloud(tmp_path / "cloud.xyz"), [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("suffix", [".ply", ".npy", ".xyz"])
def test_invalid_points_are_counted_or_dropped(tmp_path, points, suffix):
    path = tmp_path / f"cloud{suffix}"
    points[3], points[7] = np.nan, np.inf
    write_cloud(path, points)
    with pytest.raises(UserError, match="2 of 500 points are not finite"):
        read_cloud(path)
    np.testing.assert_array_equal(read_cloud(path, drop_invalid=True), np.delete(points, [3, 7], axis=0))


def test_organised_pcd_with_holes(tmp_path):
    header = "FIELDS x y z _\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 4\nWIDTH 2\nHEIGHT 2\nPOINTS 4\nDATA binary\n"
    table = np.zeros(4, [("xyz", "<f4", 3), ("_", "u1", 4)])
    table["xyz"] = [[1, 2, 3], [np.nan] * 3, [4, 5, 6], [np.nan] * 3]
    path = tmp_path / "organised.pcd"
    path.write_bytes(header.encode() + table.tobytes())
    with pytest.raises(UserError, match="2 of 4 points are not finite"):
        read_pcd(path)
    np.testing.assert_array_equal(read_pcd(path, drop_invalid=True), [[1, 2, 3], [4, 5, 6]])


def test_formats_that_cannot_be_written(tmp_path):
    for path, message in (
        (tmp_path / "cloud.pcd", "cannot write '.pcd', expected one of .ply, .npy"),
        (tmp_path / "nowhere" / "cloud.ply", "does not exist"),
    ):
        with pytest.raises(UserError, match=message):
            check_writable(path)


def test_ply_property_named_twice(tmp_path):
    path = tmp_path / "twice.ply"
    path.write_bytes(b"ply\nformat ascii 1.0\nelement vertex 1\n" + b"property float x\n" * 3 + b"end_header\n1 1 1\n")
    with pytest.raises(UserError, match="twice"):
        read_ply(path)
