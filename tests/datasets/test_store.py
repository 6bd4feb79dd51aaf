"""Prepared datasets: whole or not at all, the same twice, and refused when they are not what the manifest says."""

import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from regbench.datasets.dataset import Split
from regbench.datasets.store import data_dir, open_7scenes, open_modelnet40, open_prepared
from regbench.datasets.store_writer import write_dataset
from regbench.errors import UserError


def write(folder, seed=0, count=5, name="modelnet40", poses=False):
    rng = np.random.default_rng(seed)
    split = Split(
        rng.normal(size=(count, 16, 3)).astype(np.float32),
        np.arange(count) % 2,
        [f"chair/test/chair_{i:04d}" for i in range(count)],
        np.tile(np.eye(4), (count, 1, 1)) if poses else None,
    )
    return write_dataset(
        folder,
        name,
        description="made by a test",
        label_names=["chair", "table"],
        splits={"scans" if poses else "test": split},
        options={"seed": seed},
        left_out={"chair/test/broken": "empty"},
        remarks={},
    )


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_what_is_written_opens_read_only_and_mapped(tmp_path):
    assert write(tmp_path)
    dataset = open_modelnet40(tmp_path)
    split = dataset.splits["test"]
    assert (dataset.name, dataset.label_names, len(split)) == ("modelnet40", ["chair", "table"], 5)
    assert split.points.shape == (5, 16, 3)
    assert split.points.dtype == np.float32
    assert isinstance(split.points, np.memmap)
    assert split.poses is None
    assert split.ids[4] == "chair/test/chair_0004"
    np.testing.assert_array_equal(split.labels, [0, 1, 0, 1, 0])
    with pytest.raises(ValueError, match="read-only"):
        split.points[0] = 0
    assert write(tmp_path, name="7scenes", poses=True)
    assert open_7scenes(tmp_path).splits["scans"].poses.shape == (5, 4, 4)
    manifest = json.loads((tmp_path / "modelnet40" / "manifest.json").read_text())
    assert manifest["left_out"] == {"chair/test/broken": "empty"}
    assert len(manifest["files"]["test_points.npy"]["sha256"]) == 64


def test_preparing_twice_changes_nothing(tmp_path):
    assert write(tmp_path)
    before, inode = contents(tmp_path / "modelnet40"), (tmp_path / "modelnet40").stat().st_ino
    assert not write(tmp_path)
    assert contents(tmp_path / "modelnet40") == before
    assert (tmp_path / "modelnet40").stat().st_ino == inode
    assert [path.name for path in tmp_path.iterdir()] == ["modelnet40"]


def test_sha256_names_the_content(tmp_path):
    hashes = []
    for number, seed in enumerate((0, 0, 1)):
        write(tmp_path / str(number), seed)
        hashes.append(open_modelnet40(tmp_path / str(number)).sha256)
    assert hashes[0] == hashes[1] != hashes[2]


def test_other_input_replaces_and_open_arrays_live_on(tmp_path):
    write(tmp_path, seed=0)
    old = open_modelnet40(tmp_path).splits["test"].points
    copy = np.array(old)
    assert write(tmp_path, seed=1)
    np.testing.assert_array_equal(old, copy)
    assert not np.array_equal(open_modelnet40(tmp_path).splits["test"].points, copy)
    assert [path.name for path in tmp_path.iterdir()] == ["modelnet40"]


def test_a_damaged_dataset_is_written_again(tmp_path):
    write(tmp_path)
    before = contents(tmp_path / "modelnet40")
    path = tmp_path / "modelnet40" / "test_points.npy"
    damaged = bytearray(path.read_bytes())
    damaged[-1] ^= 1
    path.write_bytes(damaged)
    open_modelnet40(tmp_path)  # the size is right: only `verify` reads every byte
    with pytest.raises(UserError, match=r"test_points.npy: its SHA-256 is not the manifest's; prepare it again"):
        open_prepared(tmp_path, "modelnet40", verify=True)
    assert write(tmp_path)
    assert contents(tmp_path / "modelnet40") == before


def test_not_prepared(tmp_path):
    with pytest.raises(UserError) as caught:
        open_7scenes(tmp_path)
    assert str(caught.value) == (
        f"dataset 7scenes is not prepared in {tmp_path}; "
        f"run `regbench data prepare 7scenes --from FOLDER --data {tmp_path}`"
    )


@pytest.mark.parametrize(
    ("file", "damage", "message"),
    [
        ("test_points.npy", lambda content: content[:-4], "bytes, the manifest says"),
        ("test_points.npy", None, "test_points.npy: missing"),
        ("test_points.npy", lambda content: content.replace(b"<f4", b"<i4"), "holds int32 of shape"),
        ("test_points.npy", lambda content: content.replace(b"(5, 16, 3)", b"(16, 5, 3)"), "of shape (16, 5, 3)"),
        ("test_points.npy", lambda content: b"x" * len(content), "not a .npy array"),
        ("test_ids.txt", lambda content: content.replace(b"\nc", b"xc", 1), "differ in length"),
        ("test_ids.txt", lambda content: content.replace(b"\nc", b"\n\xff", 1), "test_ids.txt: cannot be read"),
        ("test_points.npy", lambda content: content.replace(b"(5, 16, 3)", b"(5, 16( 3)"), "not a readable .npy array"),
        ("manifest.json", lambda content: content[:50], "manifest.json: cannot be read"),
        ("manifest.json", lambda content: b"[" * 100_000, "manifest.json: cannot be read"),
        ("manifest.json", lambda content: content.replace(b'"files": {', b'"files": {"x": 1,'), "describe each file"),
        (
            "manifest.json",
            lambda content: content.replace(b'"format": 1', b'"format": 2'),
            "not a manifest of format 1",
        ),
        ("manifest.json", lambda content: content.replace(b'"splits"', b'"split"'), "'splits' is missing"),
        ("manifest.json", lambda content: content.replace(b'"chair"', b'"stool"'), "sha256 is not that"),
        ("manifest.json", lambda content: b"[]", "not a manifest of format 1"),
    ],
)
def test_damage_is_named(tmp_path, file, damage, message):
    write(tmp_path)
    path = tmp_path / "modelnet40" / file
    content = path.read_bytes()
    path.unlink()
    if damage is not None:
        path.write_bytes(damage(content))
    with pytest.raises(UserError) as caught:
        open_modelnet40(tmp_path)
    assert message in str(caught.value)
    assert str(path.parent) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_killed_in_the_middle_leaves_the_old_and_is_cleaned_up(tmp_path):
    """SIGKILL a real process after its first array is written, with and without an earlier preparation."""
    code = f"""
        import os, signal
        from regbench.datasets import store_writer
        from tests.datasets.test_store import write
        from pathlib import Path
        store_writer._entry = lambda path: os.kill(os.getpid(), signal.SIGKILL)
        write(Path({str(tmp_path)!r}), seed=1)
    """

    def killed():
        done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], cwd=Path(__file__).parents[2], timeout=60)
        assert done.returncode == -signal.SIGKILL
        assert (tmp_path / ".modelnet40.preparing").is_dir()

    killed()
    with pytest.raises(UserError, match="not prepared"):
        open_modelnet40(tmp_path)
    write(tmp_path, seed=0)
    before = contents(tmp_path / "modelnet40")
    killed()
    assert contents(tmp_path / "modelnet40") == before
    assert not write(tmp_path, seed=0)
    assert [path.name for path in tmp_path.iterdir()] == ["modelnet40"]


def test_killed_between_the_two_renames(tmp_path):
    write(tmp_path, seed=0)
    (tmp_path / "modelnet40").rename(tmp_path / ".modelnet40.previous")
    assert not write(tmp_path, seed=0)  # the earlier one is found again
    assert [path.name for path in tmp_path.iterdir()] == ["modelnet40"]


def test_a_failure_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda handle: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(UserError, match=f"cannot write dataset modelnet40 in {tmp_path}: No space left on device"):
        write(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_two_at_once_are_refused(tmp_path):
    import fcntl

    handle = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    with pytest.raises(UserError, match="another preparation is writing there"):
        write(tmp_path)
    os.close(handle)
    assert write(tmp_path)


def test_a_file_in_the_way(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="cannot write dataset"):
        write(tmp_path / "file")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ids": ["a"] * 2}, "different ids"),
        ({"ids": ["a", "b\nc"]}, "different ids"),
        ({"labels": np.array([0, 7])}, "labels outside 0..0"),
        ({"points": np.full((2, 4, 3), np.nan, np.float32)}, "not finite"),
        ({"points": np.zeros((2, 4, 2), np.float32)}, "do not fit"),
        ({"poses": np.zeros((3, 4, 4))}, "poses"),
    ],
)
def test_splits_that_do_not_fit_are_a_bug(tmp_path, change, message):
    parts = {"points": np.zeros((2, 4, 3), np.float32), "labels": np.zeros(2, np.int64), "ids": ["a", "b"]} | change
    with pytest.raises(ValueError, match=message):
        write_dataset(
            tmp_path / "data",
            "x",
            description="",
            label_names=["only"],
            splits={"test": Split(**parts)},
            options={},
            left_out={},
            remarks={},
        )
    assert not (tmp_path / "data").exists()


def test_data_dir(monkeypatch):
    monkeypatch.setenv("REGBENCH_DATA", "/somewhere")
    assert data_dir(Path("/given")) == Path("/given")
    assert data_dir(None) == Path("/somewhere")
    monkeypatch.delenv("REGBENCH_DATA")
    assert data_dir(None) == Path("data")
