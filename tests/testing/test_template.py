import os
import subprocess
import sys
import tomllib

import pytest

from regbench.errors import UserError
from regbench.registry import MethodRegistry, load_plugin, parse_methods
from regbench.testing import Outcome
from regbench.testing.check_registrar import _in_this_process
from regbench.testing.subject import Subject
from regbench.testing.template import write_method_package


def test_the_package_conforms_as_a_plugin_file_and_its_own_tests_pass(tmp_path):
    folder = tmp_path / "deeper" / "my_first_icp"
    written = write_method_package("my_first_icp", folder)
    assert sorted(written) == sorted(path for path in folder.rglob("*") if path.is_file())
    plugin = folder / "src" / "my_first_icp.py"
    assert set(load_plugin(plugin)) == {"my_first_icp"}
    (spec,) = parse_methods(["my_first_icp[max_iterations=20]"])
    method = MethodRegistry([plugin]).resolve(spec)
    assert method.parameters == {"max_iterations": 20}
    results = list(_in_this_process(Subject(method.cls, method.parameters)))
    assert [result for result in results if result.outcome is Outcome.FAILED] == []
    tests = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"],
        cwd=folder,
        env={**os.environ, "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
    )
    assert tests.returncode == 0, tests.stdout
    assert "2 passed" in tests.stdout


def test_the_entry_point_names_the_class(tmp_path):
    write_method_package("try_2", tmp_path / "p")
    project = tomllib.loads((tmp_path / "p" / "pyproject.toml").read_text())
    assert project["project"]["entry-points"]["regbench.registrars"] == {"try_2": "try_2:Try2Registrar"}
    assert load_plugin(tmp_path / "p" / "src" / "try_2.py")["try_2"].__name__ == "Try2Registrar"
    for text in (tmp_path / "p").rglob("*.*"):
        if text.is_file():
            assert "$" not in text.read_text()


@pytest.mark.parametrize("name", ["problem", "registrar", "registration", "kabsch"])
def test_names_of_the_contract_are_fine(tmp_path, name):
    write_method_package(name, tmp_path / "p")
    assert set(load_plugin(tmp_path / "p" / "src" / f"{name}.py")) == {name}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("", "use lower-case letters"),
        ("My-ICP", "use lower-case letters"),
        ("../escape", "use lower-case letters"),
        ("2icp", "use lower-case letters"),
        ("ähnlich", "use lower-case letters"),
        ("class", "use lower-case letters"),
        ("icp", "is taken"),
        ("json", "installed Python module"),
        ("numpy", "installed Python module"),
    ],
)
def test_bad_names_are_refused_and_nothing_is_written(tmp_path, name, words):
    with pytest.raises(UserError, match=words):
        write_method_package(name, tmp_path / "p")
    assert not (tmp_path / "p").exists()


def test_existing_folders_are_refused_and_left_alone(tmp_path):
    (tmp_path / "p").mkdir()
    with pytest.raises(UserError, match="exists already"):
        write_method_package("mine", tmp_path / "p")
    assert list((tmp_path / "p").iterdir()) == []


def test_a_folder_that_cannot_be_made_is_a_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        write_method_package("mine", tmp_path / "file" / "p")
