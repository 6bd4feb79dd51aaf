"""Compiled functions are kept where a folder can be written, by any number of processes, and never out of date."""

import ctypes
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import regbench
from regbench import doctor
from regbench.compiled.cache import NOWHERE

PACKAGE = Path(regbench.__file__).parent
SETTLE = "from regbench.compiled.cache import settle; settle()\n"
OUTER = "from numba import njit\nfrom inner import part\n@njit(cache=True)\ndef total(x):\n    return part(x) + 1\n"
INNER = "from numba import njit\n@njit(cache=True)\ndef part(x):\n    return 10 * x.sum()\n"
TOTAL = """
import numpy, sys
from outer import total as function
answer = function(numpy.ones(2, sys.argv[1]))
"""
TREE = """
import numpy
from regbench.geometry.nearest_tree import build_tree as function
points = numpy.random.default_rng(0).normal(size=(100, 3))
tree, order, _ = function(points)
answer = bool((tree == points[order]).all()) and function.__wrapped__.__code__.co_filename
"""
REPORT = """
import json
stats = function.stats
print(json.dumps([answer, stats.cache_hits.total(), stats.cache_misses.total(), stats.cache_path]))
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with two sources, one of which calls the other."""
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "outer.py").write_text(OUTER)
    (tmp_path / "package" / "inner.py").write_text(INNER)
    (tmp_path / "home").mkdir()
    yield tmp_path
    for path in tmp_path.rglob("*"):
        path.chmod(0o755)


def obey_modes():
    """Let root's programs, too, obey the modes of files: PR_CAPBSET_DROP of CAP_DAC_OVERRIDE."""
    ctypes.CDLL(None).prctl(24, 1, 0, 0, 0)


def start(folder, program, *arguments, before="", **environment):
    """Start a process that settles the cache, runs a program and reports."""
    variables = {"PATH": os.environ["PATH"], "HOME": str(folder / "home"), "PYTHONPATH": str(folder / "package")}
    return subprocess.Popen(
        [sys.executable, "-c", before + SETTLE + program + REPORT, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder / "home",
        env=variables | environment,
        preexec_fn=obey_modes,
    )


def report(process):
    """Return the answer, what was loaded, what was compiled, and where it is kept."""
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    return json.loads(output)


def read_only(folder):
    for path in [*folder.rglob("*"), folder]:
        path.chmod(path.stat().st_mode & ~0o222)


def test_two_processes_serve_a_third_from_a_package_that_cannot_be_written(folder):
    copy = folder / "package" / "regbench"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    read_only(folder / "package")
    both = [start(folder, TREE) for _ in range(2)]
    for answer, *_ in map(report, both):
        assert answer == str(copy / "geometry" / "nearest_tree.py")
    _, loaded, compiled, kept_in = report(start(folder, TREE))
    assert (loaded, compiled) == (1, 0)
    assert Path(kept_in).is_relative_to(folder / "home")


def test_where_nothing_can_be_written_every_process_compiles(folder):
    read_only(folder / "package")
    read_only(folder / "home")
    for _ in range(2):
        assert report(start(folder, TOTAL, "float64")) == [21.0, 0, 1, NOWHERE]


def test_without_a_home_no_folder_of_that_name_is_made_here(folder):
    read_only(folder / "package")
    assert report(start(folder, TOTAL, "float64", HOME="~"))[3] == NOWHERE
    assert not list((folder / "home").iterdir())


def test_the_folder_that_is_asked_for_is_used(folder):
    asked = folder / "asked"
    assert Path(report(start(folder, TOTAL, "float64", NUMBA_CACHE_DIR=str(asked)))[3]).is_relative_to(asked)


def test_two_signatures_compiled_at_the_same_time_are_both_kept(folder):
    # Both processes write while neither's files are there yet.
    slowly = """
import os, time
rename = os.replace
os.replace = lambda *paths: (time.sleep(2), rename(*paths))
"""
    both = [start(folder, TOTAL, kind, before=slowly) for kind in ("float64", "float32")]
    assert [report(process)[:3] for process in both] == [[21.0, 0, 1]] * 2
    for kind in ("float64", "float32"):
        assert report(start(folder, TOTAL, kind))[:3] == [21.0, 1, 0]


def test_a_change_in_a_source_that_is_called_compiles_its_callers_again(folder):
    assert report(start(folder, TOTAL, "float64"))[:3] == [21.0, 0, 1]
    (folder / "package" / "inner.py").write_text(INNER.replace("10", "20"))
    assert report(start(folder, TOTAL, "float64"))[:3] == [41.0, 0, 1]
    assert report(start(folder, TOTAL, "float64"))[:3] == [41.0, 1, 0]


def test_torn_files_are_replaced(folder):
    report(start(folder, TOTAL, "float64"))
    for size in (0, 300):
        for file in (folder / "package" / "__pycache__").glob("*.nbc"):
            os.truncate(file, size)
        assert report(start(folder, TOTAL, "float64"))[:3] == [21.0, 0, 1]
    assert report(start(folder, TOTAL, "float64"))[:3] == [21.0, 1, 0]


def test_damaged_files_are_replaced(folder):
    """Whatever byte is wrong, no process fails over it or runs what it says."""
    report(start(folder, TOTAL, "float64"))
    for place in (0, 40, 200, -1):
        for file in (folder / "package" / "__pycache__").glob("*.nbc"):
            content = bytearray(file.read_bytes())
            content[place] ^= 0xFF
            file.write_bytes(content)
        assert report(start(folder, TOTAL, "float64"))[:3] == [21.0, 0, 1]


@pytest.mark.parametrize(
    ("place", "compiled", "expected"),
    [
        ("/a/folder", 0, ["/a/folder (writable)", "loaded: import 0.5 s, first answer 2.0 s"]),
        ("/a/folder", 7, ["/a/folder (writable)", "compiled, and kept for the next process: import 0.5 s"]),
        (NOWHERE, 7, ["no folder can be written (NUMBA_CACHE_DIR names one)", "compiled, as in every process"]),
    ],
)
def test_doctor_says_it(monkeypatch, place, compiled, expected):
    found = {"folder": place, "import_s": 0.5, "first_answer_s": 2.0, "loaded": 2, "compiled": compiled}
    monkeypatch.setattr(doctor, "_python", lambda *arguments: json.dumps(found))
    lines = doctor._compiled_code()
    assert lines["kept in"] == expected[0]
    assert lines["our ICP"].startswith(expected[1])
