"""ModelNet40's three layouts, each from real shapes through real processes to rows of one and the same protocol.

A kill while the prepared arrays are being written is in tests/datasets/test_store.py.
"""

import json
import os
import signal
import subprocess
import sys
import textwrap

import h5py
import numpy as np
import pytest

from regbench.datasets.store import open_modelnet40
from regbench.registry import find_protocol

LAYOUTS = ("off", "hdf5", "npy")
SHAPES = {"train": 12, "test": 24}


def cut_down_pack(source, folder):
    """Copy the first shapes of the real pack's first files, names and all."""
    folder.mkdir(parents=True)
    (folder / "shape_names.txt").write_bytes((source / "shape_names.txt").read_bytes())
    for split, count in SHAPES.items():
        with (
            h5py.File(source / f"ply_data_{split}0.h5") as whole,
            h5py.File(folder / f"ply_data_{split}0.h5", "w") as part,
        ):
            part["data"], part["label"] = whole["data"][:count], whole["label"][:count]
        names = json.loads((source / f"ply_data_{split}_0_id2file.json").read_text())[:count]
        (folder / f"ply_data_{split}_0_id2file.json").write_text(json.dumps(names))


def npy_tree(pack, folder):
    """Write the pack's shapes as a tree of clouds, away from the origin and of another size."""
    for split in SHAPES:
        names = json.loads((pack / f"ply_data_{split}_0_id2file.json").read_text())
        with h5py.File(pack / f"ply_data_{split}0.h5") as file:
            for name, points in zip(names, file["data"][:], strict=True):
                category, stem = name.removesuffix(".ply").split("/")
                path = folder / category / split / f"{stem}.npy"
                path.parent.mkdir(parents=True, exist_ok=True)
                np.save(path, points * 40 + [100, 0, -7])


def regbench(*arguments):
    environment = {key: value for key, value in os.environ.items() if not key.startswith("REGBENCH")}
    command = [sys.executable, "-m", "regbench", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)


def prepare(raw, data):
    done = regbench("data", "prepare", "modelnet40", "--from", raw, "--data", data)
    assert done.returncode == 0, done.stderr
    return done


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def raw(shared_data, tmp_path_factory):
    """Each layout's folder of raw data."""
    folder = tmp_path_factory.mktemp("raw")
    cut_down_pack(shared_data / "modelnet40_ply_hdf5_1024", folder / "hdf5" / "modelnet40_ply_hdf5_1024")
    npy_tree(folder / "hdf5" / "modelnet40_ply_hdf5_1024", folder / "npy")
    (folder / "off").symlink_to(shared_data / "modelnet40_off_sample")
    return {layout: folder / layout for layout in LAYOUTS}


@pytest.fixture(scope="module")
def prepared(raw, tmp_path_factory):
    """Each layout's folder of prepared data."""
    folder = tmp_path_factory.mktemp("prepared")
    for layout in LAYOUTS:
        prepare(raw[layout], folder / layout)
    return {layout: folder / layout for layout in LAYOUTS}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_same_protocol_runs_on_every_layout(prepared, tmp_path, layout):
    problems = find_protocol("modelnet40/clean@1").open(prepared[layout])
    assert len(problems) == {"off": 12, "hdf5": 24, "npy": 24}[layout]
    for pair in problems:
        assert pair.source.shape == pair.target.shape == (784, 3)

    out = tmp_path / "run"
    where = ("--data", prepared[layout], "--out", out)
    done = regbench("run", "--method", "icp,identity", "--protocol", "modelnet40/clean@1", "--limit", 3, *where)
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in (out / "trials.jsonl").read_text().splitlines()]
    assert sorted((row["method"], row["status"]) for row in rows) == [("icp", "ok")] * 3 + [("identity", "ok")] * 3
    assert {row["protocol"] for row in rows} == {"modelnet40/clean@1"}


def test_labels_agree_between_layouts(prepared):
    datasets = {layout: open_modelnet40(folder) for layout, folder in prepared.items()}
    labels = {}
    for layout, dataset in datasets.items():
        for split in dataset.splits.values():
            for shape_id, label in zip(split.ids, split.labels, strict=True):
                category = shape_id.split("/")[0]
                assert dataset.label_names[label] == category
                assert labels.setdefault(category, label) == label, (layout, shape_id)
    assert datasets["off"].label_names == datasets["hdf5"].label_names == datasets["npy"].label_names
    for name, split in datasets["hdf5"].splits.items():
        tree = datasets["npy"].splits[name]
        assert dict(zip(split.ids, split.labels, strict=True)) == dict(zip(tree.ids, tree.labels, strict=True))
        assert len(split.ids) == SHAPES[name]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_preparing_twice_leaves_identical_bytes(raw, prepared, layout):
    before = contents(prepared[layout])
    assert "nothing changed" in prepare(raw[layout], prepared[layout]).stderr
    assert contents(prepared[layout]) == before
    assert [path.name for path in prepared[layout].iterdir()] == ["modelnet40"]


@pytest.mark.parametrize(
    ("layout", "reader"), [("off", "read_off"), ("hdf5", "read_h5_array"), ("npy", "read_npy_points")]
)
def test_killed_while_reading_leaves_nothing_and_the_next_call_works(raw, prepared, tmp_path, layout, reader):
    """SIGKILL a real process as it reads its fourth array."""
    code = f"""
        import os, signal
        from itertools import count
        from pathlib import Path
        from regbench_data_prep import modelnet40, modelnet40_source
        read, calls = modelnet40_source.{reader}, count(1)
        def read_or_die(*arguments):
            if next(calls) == 4:
                os.kill(os.getpid(), signal.SIGKILL)
            return read(*arguments)
        modelnet40_source.{reader} = read_or_die
        modelnet40.prepare(Path({str(raw[layout])!r}), Path({str(tmp_path)!r}), report=lambda line: None)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], timeout=60)
    assert done.returncode == -signal.SIGKILL
    assert list(tmp_path.iterdir()) == []
    prepare(raw[layout], tmp_path)
    assert contents(tmp_path) == contents(prepared[layout])
