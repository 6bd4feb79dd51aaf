"""ModelNet40 from each of its three layouts."""

import json
import shutil

import h5py
import numpy as np
import pytest
from regbench_data_prep.modelnet40 import CATEGORIES, prepare

from regbench.datasets.readers.off import read_off
from regbench.datasets.store import open_modelnet40, read_manifest
from regbench.datasets.surface import sample_surface
from regbench.errors import UserError

CUBE = """OFF
8 6 0
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
1 0 1
1 1 1
0 1 1
4 0 1 2 3
4 4 5 6 7
4 0 1 5 4
4 1 2 6 5
4 2 3 7 6
4 3 0 4 7
"""
FLAT = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 2 0\n0 2 0\n4 0 1 2 3\n"


def run(source, data, **options):
    lines = []
    prepare(source, data, report=lines.append, **options)
    return open_modelnet40(data), read_manifest(data / "modelnet40"), lines


def pack(folder, counts=(3, 2), points=64):
    """Write a small HDF5 pack: shapes numbered through, categories out of order."""
    folder.mkdir(parents=True)
    (folder / "shape_names.txt").write_text("\n".join(CATEGORIES) + "\n")
    rng = np.random.default_rng(0)
    for split in ("train", "test"):
        for number, count in enumerate(counts):
            labels = rng.integers(0, 40, (count, 1)).astype(np.uint8)
            with h5py.File(folder / f"ply_data_{split}{number}.h5", "w") as file:
                file["data"] = rng.normal(size=(count, points, 3)).astype(np.float32)
                file["label"] = labels
            names = [
                f"{CATEGORIES[label]}/{CATEGORIES[label]}_{number}{row}.ply" for row, label in enumerate(labels[:, 0])
            ]
            (folder / f"ply_data_{split}_{number}_id2file.json").write_text(json.dumps(names))
    return folder


@pytest.fixture
def meshes(tmp_path):
    """Return a tree in Princeton's layout: good, flat, empty, broken, truncated and pointless meshes."""
    folder = tmp_path / "raw" / "ModelNet40"
    files = {
        "chair/train/chair_0001": CUBE,
        "chair/test/chair_0002": CUBE.replace("OFF\n", "OFF"),
        "table/test/table_0001": FLAT,
        "table/test/table_0002": "",
        "table/test/table_0003": "OFF\n0 0 0\n",
        "xbox/test/xbox_0001": CUBE[:60],
        "xbox/test/xbox_0002": "OFF\n3 1 0\n1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n",
        "xbox/test/xbox_0003": CUBE.replace("4 3 0 4 7", "4 3 0 4 8"),
    }
    for name, text in files.items():
        path = folder / f"{name}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (folder / "README.txt").write_text("not a category")
    shadow = tmp_path / "raw" / "__MACOSX" / "chair" / "train"
    shadow.mkdir(parents=True)
    for path in (shadow / "._chair_0001.off", folder / "chair" / "train" / "._chair_0001.off"):
        path.write_bytes(b"\0\5\x16\7")  # what macOS puts into zips
    return folder.parent


def test_the_real_pack(shared_data, tmp_path):
    source = shared_data / "modelnet40_ply_hdf5_1024"
    dataset, manifest, lines = run(source, tmp_path)
    assert {name: len(split) for name, split in dataset.splits.items()} == {"train": 9843, "test": 2468}
    assert list(dataset.label_names) == (source / "shape_names.txt").read_text().split() == CATEGORIES
    with h5py.File(source / "ply_data_test1.h5") as file:
        np.testing.assert_array_equal(dataset.splits["test"].points[2048:], file["data"][:])
        np.testing.assert_array_equal(dataset.splits["test"].labels[2048:], file["label"][:].ravel())
    assert dataset.splits["test"].ids[0] == "piano/test/piano_0266"
    flat = [item for item in manifest["remarks"] if "/test/" in item]
    assert flat == ["person/test/person_0093", "plant/test/plant_0265", "plant/test/plant_0276"]
    assert any(line.startswith("note: person/test/person_0093: flat") for line in lines)


def test_the_real_meshes(shared_data, tmp_path):
    dataset, manifest, lines = run(shared_data / "modelnet40_off_sample", tmp_path)
    split = dataset.splits["test"]
    assert len(split) == 12
    assert manifest["left_out"] == {}
    assert "note: split test: the source has no test shapes: its train shapes are used as test" in lines
    np.testing.assert_allclose(split.points.mean(axis=1), 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(split.points, axis=2).max(axis=1), 1, atol=1e-6)
    assert [dataset.label_names[label] for label in split.labels] == [item.split("/")[0] for item in split.ids]


def test_odd_meshes_are_named_not_fatal(meshes, tmp_path):
    dataset, manifest, lines = run(meshes, tmp_path / "data")
    assert list(dataset.splits["train"].ids) == ["chair/train/chair_0001"]
    assert list(dataset.splits["test"].ids) == ["chair/test/chair_0002", "table/test/table_0001"]
    assert list(dataset.splits["test"].labels) == [CATEGORIES.index("chair"), CATEGORIES.index("table")]
    reasons = {
        "table/test/table_0002": "table_0002.off: the file is empty",
        "table/test/table_0003": "table_0003.off: the mesh has no faces",
        "xbox/test/xbox_0001": "xbox_0001.off: truncated: it claims 8 vertices and 6 faces",
        "xbox/test/xbox_0002": "xbox_0002.off: the surface has no area",
        "xbox/test/xbox_0003": "xbox_0003.off: a face names a vertex that is not there (it has 8)",
    }
    assert manifest["left_out"] == reasons
    for name, why in reasons.items():
        assert f"left out: {name}: {why}" in lines
    assert manifest["remarks"] == {"table/test/table_0001": "flat: its least extent is 0"}


def test_a_moved_source_gives_the_same_bytes_and_says_so(meshes, tmp_path):
    data = tmp_path / "data"
    run(meshes, data)
    before = {path.name: path.read_bytes() for path in (data / "modelnet40").iterdir()}
    (tmp_path / "elsewhere").mkdir()
    moved = shutil.move(meshes, tmp_path / "elsewhere" / "deeper")
    _, _, lines = run(moved.parent, data)
    assert lines[-1].endswith("already prepared, nothing changed")
    assert {path.name: path.read_bytes() for path in (data / "modelnet40").iterdir()} == before
    _, _, lines = run(moved.parent, data, seed=1)
    assert "nothing changed" not in lines[-1]


def test_a_shape_does_not_depend_on_its_neighbours(meshes, tmp_path):
    whole, _, _ = run(meshes, tmp_path / "whole")
    shutil.rmtree(meshes / "ModelNet40" / "chair")
    part, _, _ = run(meshes, tmp_path / "part")
    np.testing.assert_array_equal(whole.splits["test"].points[1], part.splits["test"].points[0])


def test_points_of_a_cube_lie_on_its_faces_in_equal_parts(tmp_path):
    (tmp_path / "cube.off").write_text(CUBE)
    mesh = read_off(tmp_path / "cube.off")
    points = sample_surface(mesh.vertices, mesh.faces, 12_000, np.random.default_rng(0))
    on_face = np.isclose(points[:, :, None], [0.0, 1.0], atol=1e-12).reshape(-1, 6)
    assert on_face.any(axis=1).all()
    np.testing.assert_allclose(on_face.sum(axis=0), 2000, atol=200)


def test_a_small_pack_in_order_and_the_first_points(tmp_path):
    source = pack(tmp_path / "raw" / "modelnet40_ply_hdf5_64")
    dataset, _, _ = run(source.parent, tmp_path / "data", points=16)
    for split in ("train", "test"):
        with (
            h5py.File(source / f"ply_data_{split}0.h5") as first,
            h5py.File(source / f"ply_data_{split}1.h5") as second,
        ):
            expected = np.concatenate([first["data"][:], second["data"][:]])[:, :16]
            labels = np.concatenate([first["label"][:], second["label"][:]]).ravel()
        np.testing.assert_array_equal(dataset.splits[split].points, expected)
        np.testing.assert_array_equal(dataset.splits[split].labels, labels)


def test_a_pack_without_names_of_its_files(tmp_path):
    source = pack(tmp_path / "raw")
    for path in source.glob("*.json"):
        path.unlink()
    dataset, _, _ = run(source, tmp_path / "data", points=64)
    assert dataset.splits["test"].ids[3].endswith("/test/ply_data_test1_0000")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda folder: (folder / "ply_data_test0.h5").write_bytes(b"x" * 99),
            "ply_data_test0.h5: not a readable HDF5",
        ),
        (lambda folder: (folder / "shape_names.txt").unlink(), "shape_names.txt: no such file"),
        (lambda folder: (folder / "shape_names.txt").write_text("chair\n"), "has labels outside 0..0"),
        (lambda folder: (folder / "ply_data_test_0_id2file.json").write_text("{"), "not a readable JSON"),
        (lambda folder: (folder / "ply_data_test_0_id2file.json").write_text("[1]"), "expected a list of 3 file names"),
        (lambda folder: (folder / "ply_data_test_0_id2file.json").write_text('["a/a", "b/b", "c/c"]'), "disagree"),
    ],
)
def test_a_broken_pack(tmp_path, damage, message):
    source = pack(tmp_path / "raw")
    damage(source)
    with pytest.raises(UserError) as caught:
        run(source, tmp_path / "data", points=64)
    assert message in str(caught.value)
    assert not (tmp_path / "data").exists()


def test_more_points_than_the_pack_has(tmp_path):
    with pytest.raises(UserError, match="has 64 points a shape, 65 wanted; ask for fewer with --points"):
        run(pack(tmp_path / "raw"), tmp_path / "data", points=65)


def test_the_three_layouts_agree_on_labels(shared_data, tmp_path):
    """A tree of .npy clouds made from the pack: same shapes, same labels, the same points in another order."""
    whole, _, _ = run(pack(tmp_path / "pack", counts=(8,)), tmp_path / "from_pack", points=64)
    scaled = {}
    for split in whole.splits.values():
        for shape_id, points in zip(split.ids, split.points, strict=True):
            path = tmp_path / "npy" / f"{shape_id}.npy"
            path.parent.mkdir(parents=True, exist_ok=True)
            np.save(path, np.column_stack([points * 3 + 5, np.zeros(len(points))]))  # a fourth column is passed over
            centred = points - points.mean(axis=0)
            scaled[shape_id] = centred / np.linalg.norm(centred, axis=1).max()
    tree, _, _ = run(tmp_path / "npy", tmp_path / "from_npy", points=64)
    for name, split in tree.splits.items():
        labels = dict(zip(whole.splits[name].ids, whole.splits[name].labels, strict=True))
        assert list(split.labels) == [labels[shape_id] for shape_id in split.ids]
        for shape_id, points in zip(split.ids, split.points, strict=True):
            order, expected = np.lexsort(points.T), scaled[shape_id]
            np.testing.assert_allclose(points[order], expected[np.lexsort(expected.T)], atol=1e-5)
            assert not np.allclose(points, expected, atol=1e-3)  # in random order
    meshes, _, _ = run(shared_data / "modelnet40_off_sample", tmp_path / "from_off", points=64)
    assert list(meshes.label_names) == list(tree.label_names) == list(whole.label_names) == CATEGORIES


def test_odd_clouds_are_named(tmp_path):
    folder = tmp_path / "raw" / "mine" / "test"
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    for name, cloud in {
        "good": rng.normal(size=(40, 3)),
        "few": rng.normal(size=(5, 3)),
        "nan": np.full((40, 3), np.nan),
        "same": np.ones((40, 3)),
        "thin": rng.normal(size=(40, 2)),
    }.items():
        np.save(folder / f"{name}.npy", cloud)
    dataset, manifest, _ = run(tmp_path / "raw", tmp_path / "data", points=32)
    assert dataset.label_names == ["mine"]  # not ModelNet40's: the folders' own names
    assert dataset.splits["test"].ids == ["mine/test/good"]
    assert manifest["left_out"] == {
        "mine/test/few": "few.npy: has 5 points, 32 wanted",
        "mine/test/nan": "nan.npy: 40 of 40 points are not finite (NaN or infinite)",
        "mine/test/same": "same.npy: all points are one",
        "mine/test/thin": "thin.npy: expected an array of shape (N, 3), got (40, 2)",
    }


def test_folders_of_something_else(tmp_path):
    with pytest.raises(UserError, match="not a ModelNet40 folder; expected <category>"):
        run(tmp_path, tmp_path / "data")
    with pytest.raises(UserError, match="no such folder"):
        run(tmp_path / "nowhere", tmp_path / "data")
    path = tmp_path / "chair" / "test" / "chair_0001.off"
    path.parent.mkdir(parents=True)
    path.touch()
    with pytest.raises(UserError, match=r"none of its shapes can be used.*chair_0001.off: the file is empty"):
        run(tmp_path, tmp_path / "data")
