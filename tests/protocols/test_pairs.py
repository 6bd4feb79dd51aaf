"""A user's own pairs: what is wrong with the table is one line that names it."""

from pathlib import Path

import numpy as np
import pytest

from regbench.errors import UserError
from regbench.registry import find_protocol

HEADER = "source,target,T_target_source\n"


@pytest.fixture
def folder(tmp_path):
    rng = np.random.default_rng(0)
    for name in ("a", "b"):
        np.save(tmp_path / f"{name}.npy", rng.normal(size=(20, 3)))
    (tmp_path / "truth.txt").write_text("1 0 0 5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    return tmp_path


def opened(folder, table):
    (folder / "pairs.csv").write_bytes(table if isinstance(table, bytes) else table.encode())
    return find_protocol(f"pairs:{folder}").open(Path("unused"))


def test_pairs_with_and_without_an_answer(folder):
    problems = opened(folder, HEADER + "a.npy,b.npy,truth.txt\nb.npy,a.npy,\n")
    first, second = problems
    np.testing.assert_array_equal(first.source, np.load(folder / "a.npy"))
    np.testing.assert_array_equal(first.target, np.load(folder / "b.npy"))
    assert first.T_target_source[0, 3] == 5
    assert second.T_target_source is None
    np.save(folder / "a.npy", np.eye(3))
    assert opened(folder, HEADER + "a.npy,b.npy,truth.txt\nb.npy,a.npy,\n").data_sha256 != problems.data_sha256


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("", "needs the columns source and target, has none"),
        ('"sour\nce",target\n', r"has 'sour\nce', 'target'"),
        ("source,target,truth\na.npy,b.npy,\n", "unknown column 'truth'"),
        (HEADER, "holds no pair"),
        (HEADER + "a.npy\n", "line 2 must name a source and a target"),
        (HEADER + "a.npy,b.npy,truth.txt,more\n", "line 2 must name a source and a target"),
        (HEADER + "a.npy,gone.npy,\n", "names 'gone.npy': no such file"),
        (HEADER + f"a.npy,{'b' * 300}.npy,\n", ".npy': cannot be read (File name too long)"),
        (HEADER + 'a.npy,"b\n.npy",\n', r"names 'b\n.npy': no such file"),
        (b"source,target\n\xff,b.npy\n", "cannot be read as a table"),
    ],
)
def test_a_table_that_cannot_be_used(folder, table, message):
    with pytest.raises(UserError) as caught:
        opened(folder, table)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{folder / 'pairs.csv'}: ")
    assert "\n" not in str(caught.value)


def test_no_table(tmp_path):
    with pytest.raises(UserError, match=r"no pairs\.csv"):
        find_protocol(f"pairs:{tmp_path}").open(Path("unused"))


def test_a_truth_that_printing_rounded_is_made_exact_and_a_wrong_one_is_named_at_once(folder):
    (folder / "truth.txt").write_text("0.8 -0.601 0 5\n0.6 0.8 0 0\n0 0 1 0\n0 0 0 1\n")
    T = opened(folder, HEADER + "a.npy,b.npy,truth.txt\n").pair(0).T_target_source
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(T[:2, :2], [[0.8, -0.6], [0.6, 0.8]], atol=1e-3)
    (folder / "truth.txt").write_text("2 0 0 5\n0 2 0 0\n0 0 2 0\n0 0 0 1\n")
    with pytest.raises(UserError, match=r"truth\.txt: is not a rigid motion: its rotation is not orthonormal"):
        opened(folder, HEADER + "a.npy,b.npy,truth.txt\n")
