"""Damaged files get one clear line, never a traceback: a short run of benchmarks/fuzz.py; and what it has found."""

import json
import os
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from regbench_data_prep.archive import unpack

from regbench.datasets.readers.child import read_in_child
from regbench.errors import UserError
from regbench.report.rundata import read_run
from tests.runner.helpers import run_here

FUZZ = Path(__file__).parents[2] / "benchmarks" / "fuzz.py"


def test_three_hundred_damaged_files_of_every_kind():
    answer = subprocess.run(
        [sys.executable, str(FUZZ), "all", "--inputs", "300"], capture_output=True, text=True, timeout=600
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert answer.stdout.count(" 0 findings") == 20, answer.stdout


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The files of a run."""
    out = tmp_path_factory.mktemp("fuzz") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(out.parent)
        run_here(out, method=["identity"], limit=1)
    return {name: (out / name).read_text() for name in ("manifest.json", "trials.jsonl", "problems.jsonl")}


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("trials.jsonl", '"problem":0', '"problem":Infinity'),
        ("trials.jsonl", '"time_ms":', f'"time_ms":1{"0" * 400},"was":'),
        ("trials.jsonl", "[[1.0,", f"[[1{'0' * 400},"),
        ("trials.jsonl", "[[1.0,", "[[1e308,"),
        ("trials.jsonl", '"repeat":0', f'"repeat":1{"0" * 30}'),
        ("problems.jsonl", '"problem":0', '"problem":Infinity'),
        ("manifest.json", '"n": 1', '"n": Infinity'),
    ],
)
def test_numbers_without_bounds_are_refused(finished, tmp_path, file, old, new):
    for name, text in finished.items():
        assert name != file or old in text
        (tmp_path / name).write_text(text.replace(old, new) if name == file else text)
    with pytest.raises(UserError) as caught:
        read_run(tmp_path)
    assert file in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_metric_that_is_no_name_is_unknown(finished, tmp_path, capsys):
    from regbench.cli.main import main

    for name, text in finished.items():
        (tmp_path / name).write_text(text)
    manifest = json.loads(finished["manifest.json"])
    manifest["protocols"][0]["headline_metrics"] = [0.5]
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    assert main(["table", str(tmp_path)]) == 2
    assert "unknown metric '0.5'" in capsys.readouterr().err


def test_a_member_without_a_name_is_a_broken_archive(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("x", "content")
    data = (tmp_path / "a.zip").read_bytes()
    central = data.index(b"PK\x01\x02")
    # The central directory says that the name has no letters and the extra field one.
    changed = data[: central + 28] + b"\0\0\1\0" + data[central + 32 :]
    (tmp_path / "a.zip").write_bytes(changed)
    with pytest.raises(UserError, match="broken archive"):
        unpack(tmp_path / "a.zip", tmp_path / "out")


def test_a_crash_of_the_library_is_one_line(tmp_path):
    """Found by atheris: a chunked array whose damaged lengths let HDF5 reach past its memory (SIGSEGV)."""

    def dies():
        os.kill(os.getpid(), signal.SIGSEGV)

    with pytest.raises(UserError, match=r"pack\.h5: not a readable HDF5 file \(its library died of it: SIGSEGV\)"):
        read_in_child(tmp_path / "pack.h5", "HDF5 file", dies)


@pytest.mark.parametrize("dtype", ["<f4", ">f8", "u1", "<i8"])
@pytest.mark.parametrize("shape", [(0,), (5,), (2, 3, 4)])
def test_an_array_comes_back_from_a_child_as_it_is(dtype, shape):
    array = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    found = read_in_child(Path("x"), "file", lambda: array)
    assert found.dtype == array.dtype
    assert found.shape == array.shape
    assert found.tobytes() == array.tobytes()
    assert found.flags.writeable
