"""A method's fingerprint changes with whatever its answers depend on, and with nothing else."""

import sys
from pathlib import Path

import pytest

from regbench.registry import MethodRegistry, parse_methods
from regbench.runner.fingerprint import method_fingerprint

PLUGIN = """
import helper_of_plugin
import numpy as np
from regbench import Registration

class Mine:
    name = "mine"
    def __init__(self, *, step: float = 0.5):
        self.step = step
    def register(self, problem):
        return Registration(T_target_source=np.eye(4))
"""


def fingerprint(path, asked="mine"):
    for name in [name for name in sys.modules if name.startswith(("regbench_plugin_mine_", "helper_of_plugin"))]:
        del sys.modules[name]
    from regbench.runner import fingerprint as module

    module._imported.cache_clear()
    return method_fingerprint(MethodRegistry([path]).resolve(parse_methods([asked])[0]))


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    (tmp_path / "helper_of_plugin.py").write_text("A = 1\n")
    path = tmp_path / "mine.py"
    path.write_text(PLUGIN)
    return path


def test_it_is_stable(plugin):
    assert fingerprint(plugin) == fingerprint(plugin)


def test_it_changes_with_the_source(plugin):
    before = fingerprint(plugin)
    plugin.write_text(PLUGIN.replace("0.5", "0.6").replace("float = 0.6", "float = 0.5") + "# a comment\n")
    assert fingerprint(plugin) != before


def test_it_changes_with_a_module_beside_it(plugin):
    before = fingerprint(plugin)
    plugin.with_name("helper_of_plugin.py").write_text("A = 2\n")
    assert fingerprint(plugin) != before


def test_it_does_not_change_with_an_unrelated_file(plugin):
    before = fingerprint(plugin)
    plugin.with_name("unrelated.py").write_text("A = 2\n")
    assert fingerprint(plugin) == before


def test_it_changes_with_a_parameter(plugin):
    assert fingerprint(plugin) != fingerprint(plugin, "mine[step=0.7]")


def test_it_changes_with_a_data_file_of_the_method(plugin):
    weights = plugin.with_name("weights.bin")
    text = PLUGIN + f"    def data_files(self):\n        return [Path({str(weights)!r})]\n"
    plugin.write_text("from pathlib import Path\n" + text)
    absent = fingerprint(plugin)
    weights.write_bytes(b"1")
    first = fingerprint(plugin)
    assert first == fingerprint(plugin)
    weights.write_bytes(b"2")
    assert len({absent, first, fingerprint(plugin)}) == 3


def test_latentcem_depends_on_its_weights():
    from regbench.runner.fingerprint import data_sha256

    def files(asked):
        return data_sha256(MethodRegistry().resolve(parse_methods([asked])[0]))

    assert len(files("latentcem")) == 1
    assert files("latentcem[model=equivariant,weights=none]") == []
    assert len(files("latentcem[model=equivariant,refine=verify]")) == 2
    assert files("latentcem[weights=nowhere.safetensors]") == [None]


def test_an_installed_method_depends_on_its_helpers_and_shared_geometry():
    from regbench.runner.fingerprint import _imported

    method = MethodRegistry().resolve(parse_methods(["icp"])[0])
    module = sys.modules[method.cls.__module__]
    names = _imported(Path(module.__file__), module.__package__)
    assert any(name.startswith("regbench_baselines.") for name in names)
