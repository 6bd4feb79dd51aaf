"""The compiled sampling of meshes: the same points as the plain one, and uniform by area."""

import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from regbench_data_prep import mesh_sampling
from regbench_data_prep.mesh_sampling import sample_mesh
from scipy import stats

from regbench.datasets.readers.off import read_off
from regbench.datasets.surface import sample_surface, triangle_areas


def soup(face_count, seed=0):
    """Return vertices and faces that share them, of very different areas, some without any."""
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(face_count // 2 + 3, 3)) * rng.lognormal(sigma=2, size=(face_count // 2 + 3, 1))
    faces = rng.integers(len(vertices), size=(face_count, 3))
    faces[::5, 2] = faces[::5, 1]
    return vertices, faces


@pytest.mark.parametrize("face_count", [2, 3, 17, 1000, 40_000])
@pytest.mark.parametrize("count", [0, 1, 1024])
def test_the_same_bits_as_the_plain_form(face_count, count):
    vertices, faces = soup(face_count)
    table = np.column_stack([np.full(face_count, 3), faces])[:, 1:]  # as a reader returns it: a view, not contiguous
    plain_rng, rng = np.random.default_rng(1), np.random.default_rng(1)
    plain = sample_surface(vertices, faces, count, plain_rng)
    np.testing.assert_array_equal(sample_mesh(vertices, table, count, rng), plain)
    assert rng.random() == plain_rng.random(), "both must leave the generator at the same place"


def test_the_same_bits_on_real_meshes(shared_data):
    paths = sorted((shared_data / "modelnet40_off_sample").rglob("*.off"))
    assert len(paths) == 12
    for path in paths:
        mesh = read_off(path)
        plain = sample_surface(mesh.vertices, mesh.faces, 1024, np.random.default_rng(0))
        ours = sample_mesh(mesh.vertices, mesh.faces, 1024, np.random.default_rng(0))
        np.testing.assert_array_equal(ours, plain, err_msg=path.name)


def test_faces_are_drawn_in_proportion_to_their_area_and_in_random_order():
    rng = np.random.default_rng(0)
    # Apart along x, so that a point tells its face.
    triangles = rng.random((30, 3, 3)) * rng.lognormal(size=(30, 1, 1)) / 10 + np.arange(30)[:, None, None] * [10, 0, 0]
    triangles[7, 2] = triangles[7, 1]
    vertices, faces = triangles.reshape(-1, 3), np.arange(90).reshape(-1, 3)
    areas = triangle_areas(vertices, faces)
    drawn = (sample_mesh(vertices, faces, 100_000, rng)[:, 0] // 10).astype(int)
    counts = np.bincount(drawn, minlength=30)
    assert counts[7] == 0
    used = areas / areas.sum() * len(drawn) > 5
    expected = areas[used] / areas[used].sum() * counts[used].sum()
    assert used.sum() > 20
    assert stats.chisquare(counts[used], expected).pvalue > 1e-3
    assert abs(stats.spearmanr(drawn, np.arange(len(drawn))).statistic) < 0.02
    assert abs(stats.spearmanr(drawn[1:], drawn[:-1]).statistic) < 0.02


def test_points_are_uniform_within_a_face():
    points = sample_mesh(np.eye(3)[[2, 0, 1]] * [1, 1, 0], np.array([[0, 1, 2]]), 20_000, np.random.default_rng(0))
    assert (points[:, :2] >= 0).all()
    # The part of the unit triangle with x + y < s has area s^2 of the whole.
    assert stats.kstest(points[:, :2].sum(axis=1) ** 2, "uniform").pvalue > 1e-3
    assert stats.kstest(1 - (1 - points[:, 0]) ** 2, "uniform").pvalue > 1e-3


@pytest.mark.parametrize(
    ("vertices", "faces", "error", "message"),
    [
        (np.eye(3), np.empty((0, 3), np.int64), ValueError, "no area"),
        (np.ones((3, 3)), np.array([[0, 1, 2]]), ValueError, "no area"),
        (np.eye(3) * 1e200, np.array([[0, 1, 2]]), ValueError, "too large"),
        (np.eye(3), np.array([[0, 1, 3]]), IndexError, "a vertex that is not there"),
        (np.eye(3), np.array([[0, 1, -1]]), IndexError, "a vertex that is not there"),
    ],
)
def test_surfaces_that_cannot_be_sampled(vertices, faces, error, message):
    with pytest.raises(error, match=message):
        sample_mesh(vertices, faces, 5, np.random.default_rng(0))


@pytest.mark.parametrize("writable", ["__pycache__", "home", "nothing"])
def test_it_compiles_wherever_the_package_is_installed(tmp_path, writable):
    """A copy of the module, its folders in the way of numba's caches: a file where a folder would have to be."""
    package = tmp_path / "package"
    package.mkdir()
    shutil.copy(mesh_sampling.__file__, package / "mesh_sampling.py")
    home = tmp_path / "home"
    if writable == "nothing":
        home.touch()
    if writable != "__pycache__":
        (package / "__pycache__").touch()
    code = """
        import numpy as np
        import mesh_sampling
        points = mesh_sampling.sample_mesh(np.eye(3), np.array([[0, 1, 2]]), 5, np.random.default_rng(0))
        assert np.allclose(points.sum(axis=1), 1)
    """
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA", "XDG"))}
    repository = str(Path(__file__).parents[2])
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=environment | {"PYTHONPATH": f"{package}:{repository}", "HOME": str(home)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert bool(list(package.rglob("*.nbi"))) == (writable == "__pycache__")
    assert bool(list(home.rglob("*.nbi"))) == (writable == "home")


@pytest.mark.parametrize("module", ["regbench.cli.main", "regbench.datasets.cad_demo", "regbench_data_prep.modelnet40"])
def test_numba_is_not_imported_before_a_mesh_is_sampled(module):
    code = f"import sys, {module}; assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
