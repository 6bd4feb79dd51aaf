"""Bad input: one clear line that says which file and what is wrong, exit code 2, no traceback, nothing lost."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image

from regbench.cli.main import main

PLY = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
PCD = b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n"

CLOUDS = {
    "empty.ply": b"",
    "truncated.ply": PLY + b"0 0 0\n",
    "nan.ply": PLY + b"0 0 0\n1 nan 0\n0 0 1\n",
    "words.ply": PLY + b"0 0 0\n1 one 0\n0 0 1\n",
    "notply.ply": b"\x00\x01\x02" * 50,
    "empty.pcd": b"",
    "truncated.pcd": PCD + b"0 0 0\n",
    "nan.pcd": PCD + b"0 0 0\nnan 0 0\n0 0 1\n",
    "empty.off": b"",
    "truncated.off": b"OFF\n8 6 0\n0 0 0\n",
    "nan.off": b"OFF\n3 1 0\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n",
    "empty.npy": b"",
    "pickle.npy": None,
    "wrong_shape.npy": None,
    "complex.npy": None,
    "nan.npy": None,
    "truncated.npy": None,
    "unknown.xyzzy": b"1 2 3\n",
}


def make(path):
    """Write the bad file of that name."""
    good = np.random.default_rng(0).normal(size=(20, 3))
    arrays = {
        "pickle.npy": np.array([{"a": 1}], dtype=object),
        "wrong_shape.npy": good.T,
        "complex.npy": good * 1j,
        "nan.npy": np.where(good > 1, np.nan, good),
        "truncated.npy": good,
    }
    if path.name in arrays:
        np.save(path, arrays[path.name], allow_pickle=True)
        if path.name == "truncated.npy":
            path.write_bytes(path.read_bytes()[:-100])
    else:
        path.write_bytes(CLOUDS[path.name])


def refused(capsys, arguments, *words):
    """Check for exit code 2 and one line on stderr that holds the words."""
    assert main([str(argument) for argument in arguments]) == 2
    error = capsys.readouterr().err
    lines = [line for line in error.splitlines() if line.startswith("regbench: ")]
    assert len(lines) == 1, error
    assert "Traceback" not in error
    for word in words:
        assert str(word) in lines[0], lines[0]


@pytest.mark.parametrize("name", CLOUDS)
def test_bad_clouds(tmp_path, capsys, name):
    make(tmp_path / name)
    np.save(tmp_path / "good.npy", np.random.default_rng(0).normal(size=(20, 3)))
    refused(capsys, ["align", tmp_path / name, tmp_path / "good.npy", "-m", "identity"], name)
    refused(capsys, ["align", tmp_path / "good.npy", tmp_path / name, "-m", "identity"], name)


def test_missing_file_and_folder_for_a_file(tmp_path, capsys):
    np.save(tmp_path / "good.npy", np.eye(3))
    refused(capsys, ["align", tmp_path / "gone.ply", tmp_path / "good.npy", "-m", "identity"], "gone.ply")
    (tmp_path / "folder.ply").mkdir()
    refused(capsys, ["align", tmp_path / "folder.ply", tmp_path / "good.npy", "-m", "identity"], "folder.ply")


@pytest.mark.parametrize("kind", ["truncated", "empty", "wrong_type", "no_data", "nan", "short"])
def test_bad_hdf5_packs(tmp_path, capsys, kind):
    pack = tmp_path / "pack"
    pack.mkdir()
    file = pack / "ply_data_test0.h5"
    (pack / "shape_names.txt").write_text("airplane\nchair\n")
    for split in ("train", "test"):
        (pack / f"{split}_files.txt").write_text(f"data/modelnet40/ply_data_{split}0.h5\n")
    for path in (pack / "ply_data_train0.h5", file):
        with h5py.File(path, "w") as h5:
            points = np.random.default_rng(0).normal(size=(2, 1024, 3)).astype("f4")
            if path == file and kind == "nan":
                points[1, 5] = np.nan
            if path == file and kind == "short":
                points = points[:, :10]
            if not (path == file and kind == "no_data"):
                h5["data"] = points.astype("S4") if path == file and kind == "wrong_type" else points
            h5["label"] = np.array([[0], [1]], dtype="u1")
    if kind == "truncated":
        file.write_bytes(file.read_bytes()[:3000])
    if kind == "empty":
        file.write_bytes(b"")
    refused(capsys, ["data", "prepare", "modelnet40", "--from", pack, "--data", tmp_path / "data"], file.name)
    assert not (tmp_path / "data" / "modelnet40").exists()


@pytest.mark.parametrize("kind", ["truncated", "empty", "eight_bit", "no_pose", "bad_pose"])
def test_bad_depth_frames(tmp_path, capsys, kind):
    folder = tmp_path / "raw" / "redkitchen" / "seq-01"
    folder.mkdir(parents=True)
    depth = np.random.default_rng(0).integers(500, 5000, (480, 640), dtype=np.uint16)
    png = folder / "frame-000000.depth.png"
    Image.fromarray(depth).save(png)
    np.savetxt(folder / "frame-000000.pose.txt", np.eye(4))
    named = png.name
    if kind == "truncated":
        png.write_bytes(png.read_bytes()[:5000])
    elif kind == "empty":
        png.write_bytes(b"")
    elif kind == "eight_bit":
        Image.fromarray((depth // 20).astype(np.uint8)).save(png)
    elif kind == "no_pose":
        (folder / "frame-000000.pose.txt").unlink()
        named = "frame-000000"
    else:
        (folder / "frame-000000.pose.txt").write_text("1 0 0\n0 1 zero 0\n")
        named = "frame-000000.pose.txt"
    refused(capsys, ["data", "prepare", "7scenes", "--from", tmp_path / "raw", "--data", tmp_path / "data"], named)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("method = ", "run.toml"),
        ("metod = 'icp'", "did you mean 'method'"),
        ("method = 'identity'\nlimit = 'many'", "limit"),
        ("method = 'identity'\nrepeat = 0", "repeat"),
        ("method = 'identity'\ntimeout = -1.0", "timeout"),
        ("method = 'identity'\ntimeout = inf", "timeout"),
        ("method = 'identity'\nmemory = inf", "memory"),
        ("method = 'identity'\nmemory = 1" + "0" * 400, "memory"),
        ("method = 'identity'\ntimeout = true", "timeout"),
    ],
)
def test_bad_configuration(tmp_path, capsys, text, words):
    (tmp_path / "run.toml").write_text(text)
    refused(capsys, ["run", "--config", tmp_path / "run.toml", "--out", tmp_path / "run"], words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run"], "no method given"),
        (["run", "-m", "ipc"], "did you mean 'icp'"),
        (["run", "-m", "icp[max_distanse=1]"], "did you mean 'max_distance'"),
        (["run", "-m", "icp[max_distance=far]"], "expected a number"),
        (["run", "-m", "icp[preset=papre]"], "did you mean 'paper'"),
        (["run", "-m", "icp["], "cannot read method"),
        (["run", "-m", "icp,icp"], "asked for twice"),
        (["run", "-m", "icp", "-p", "demo@2"], "did you mean 'demo@1'"),
        (["run", "-m", "icp", "--limit", "0"], "limit"),
        (["run", "-m", "icp", "--limit", "ten"], "--limit"),
        (["run", "-m", "icp", "--seed", "-1"], "--seed = -1"),
        (["run", "-m", "icp", "--seed", "4294967296"], "--seed"),
        (["run", "-m", "icp", "--memory", "inf"], "--memory"),
        (["run", "-m", "icp", "--jobs", "1000"], "needs 1000 cores"),
        (["run", "-m", "icp", "--out", "x" * 300], "cannot be made"),
        (["table", "x" * 300], "is not a run"),
        (["run", "-m", "icp", "--device", "tpu"], "device"),
        (["run", "-m", "icp", "--device", "cuda"], "--device cuda: "),
        (["run", "-m", "icp", "--executor", "slurm"], "unknown executor"),
        (["run", "-m", "icp", "--plugin", "gone.py"], "gone.py: no such file"),
        (["run", "-m", "icp", "-p", "pairs:gone"], "no pairs.csv"),
        (["run", "-m", "icp", "-p", "modelnet40/clean@1"], "regbench data prepare modelnet40"),
        (["run", "--fast"], "--fast"),
        (["table", "gone"], "is not a run"),
        (["table", "--format", "word"], "word"),
        (["ls", "planets"], "planets"),
        (["check", "icp,fgr"], "one method at a time"),
        (["new", "method", "2fast"], "2fast"),
        (["data", "prepare", "modelnet41", "--from", "."], "did you mean 'modelnet40'"),
        (["data", "prepare", "modelnet40", "--from", "gone"], "gone"),
        (["data", "get", "modelnet41"], "did you mean 'modelnet40'"),
    ],
)
def test_bad_options(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("REGBENCH_DATA", raising=False)
    refused(capsys, arguments, words)
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("option", [("--threads", 0), ("--timeout", -1), ("--memory", 0), ("--seed", -1)])
def test_bad_options_of_align(tmp_path, capsys, option):
    np.save(tmp_path / "a.npy", np.eye(3))
    refused(capsys, ["align", tmp_path / "a.npy", tmp_path / "a.npy", "-m", "identity", *option], option[0])


def test_a_save_that_cannot_be_written_is_refused_before_work(tmp_path, capsys):
    np.save(tmp_path / "a.npy", np.random.default_rng(0).normal(size=(20, 3)))
    command = ["align", tmp_path / "a.npy", tmp_path / "a.npy", "-m", "identity", "--save"]
    refused(capsys, [*command, tmp_path / "no" / "b.ply"], "does not exist")
    refused(capsys, [*command, tmp_path / "b.docx"], "b.docx")


def test_a_damaged_run_is_named(tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["run", "-m", "identity", "--limit", "2", "--out", str(out)]) == 0
    capsys.readouterr()
    (out / "problems.jsonl").write_text("{")
    refused(capsys, ["table", out], "problems.jsonl")
    (out / "manifest.json").write_text("[]")
    refused(capsys, ["table", out], "manifest.json")


def test_a_constructor_against_the_contract_is_explained(tmp_path, capsys):
    Path(tmp_path / "odd.py").write_text(
        "class Odd:\n    name = 'odd'\n    def __init__(self, x): pass\n    def register(self, p): ...\n"
    )
    refused(capsys, ["run", "-m", "odd", "--plugin", tmp_path / "odd.py"], "must be keyword-only with a default")
