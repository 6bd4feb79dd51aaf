"""Writes a plugin package with a method that works and conforms: where an author of a method starts."""

from __future__ import annotations

import importlib.util
import keyword
import re
import shutil
from pathlib import Path
from string import Template

from regbench.errors import UserError
from regbench.registry import REGISTRARS, names


def write_method_package(name: str, folder: Path) -> list[Path]:
    """Write an installable package with one method, its test and a README into a new folder.

    Args:
        name: The method's name, and its module's: lower-case letters, digits and underscores.
        folder: The folder to make; its parents are made too.

    Returns:
        The files written.

    Raises:
        UserError: The name is not fit or taken, the folder exists, or it cannot be written.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise UserError(f"method name '{name}': use lower-case letters, digits and _, starting with a letter")
    if name in names(REGISTRARS):
        raise UserError(f"method name '{name}' is taken (see `regbench ls methods`); choose another")
    if importlib.util.find_spec(name) is not None:
        raise UserError(f"method name '{name}' is the name of an installed Python module; choose another")
    if folder.exists():
        raise UserError(f"{folder} exists already; name another folder, or move it away")
    words = {"name": name, "cls": "".join(map(str.capitalize, name.split("_"))) + "Registrar"}
    try:
        written = []
        for path, text in _FILES.items():
            file = folder / Template(path).substitute(words)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(Template(text).substitute(words), encoding="utf-8")
            written.append(file)
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise UserError(f"{folder} cannot be written: {error.strerror or error}") from None
    return written


_PYPROJECT = """\
[build-system]
requires = ["setuptools>=77"]
build-backend = "setuptools.build_meta"

[project]
name = "regbench-$name"
version = "0.1.0"
description = "The registration method $name, for regbench"
requires-python = ">=3.11"
dependencies = ["numpy", "regbench", "scipy"]

[project.entry-points."regbench.registrars"]
$name = "$name:$cls"

[tool.setuptools]
package-dir = { "" = "src" }
py-modules = ["$name"]

[tool.pytest.ini_options]
pythonpath = ["src"]
testpaths = ["tests"]
"""

_MODULE = '''\
"""The registration method $name: replace `register` by your own."""

import numpy as np
from scipy.spatial import cKDTree

from regbench import Problem, Registrar, Registration
from regbench.geometry.kabsch import kabsch
from regbench.geometry.se3 import se3, transform


class $cls(Registrar):
    """Point-to-point ICP from matched centroids.

    Args:
        max_iterations: Most iterations.
    """

    name = "$name"

    def __init__(self, *, max_iterations: int = 100) -> None:
        self.max_iterations = max_iterations

    def register(self, problem: Problem) -> Registration:
        """Estimate T_target_source, (4, 4) float64."""
        tree = cKDTree(problem.target)
        T_target_source = se3(np.eye(3), problem.target.mean(axis=0) - problem.source.mean(axis=0))
        matches = None
        for iteration in range(1, self.max_iterations + 1):
            earlier = matches
            _, matches = tree.query(transform(T_target_source, problem.source))
            if earlier is not None and np.array_equal(matches, earlier):
                return Registration(T_target_source=T_target_source, converged=True, iterations=iteration)
            T_target_source = kabsch(problem.source, problem.target[matches])
        return Registration(T_target_source=T_target_source, converged=False, iterations=self.max_iterations)
'''

_TEST = """\
from regbench.testing import assert_conforms

from $name import $cls


def test_conforms():
    assert_conforms($cls)


def test_conforms_with_other_parameters():
    assert_conforms($cls, {"max_iterations": 50})
"""

_README = """\
# $name

A method for regbench, in `src/$name.py`.

Without installing it:

    regbench check $name --plugin src/$name.py
    regbench run --method $name,icp --plugin src/$name.py

Installed, it is found by its name alone:

    pip install -e .
    regbench check $name
    regbench run --method $name,icp
    regbench run --method "$name[max_iterations=10,100]"

Its tests:

    pytest
"""

_FILES = {
    "pyproject.toml": _PYPROJECT,
    "README.md": _README,
    "src/$name.py": _MODULE,
    "tests/test_$name.py": _TEST,
}
