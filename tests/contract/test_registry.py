import pytest

from regbench.errors import UserError
from regbench.registry import (
    REGISTRARS,
    MethodRegistry,
    find_protocol,
    load,
    load_plugin,
    names,
    parse_methods,
)

PLUGIN = """
from regbench import Problem, Registrar, Registration
from dataclasses import dataclass

class Mine(Registrar):
    name = "mine"
    def __init__(self, *, distance: float = 1.0):
        self.distance = distance
    def register(self, problem):
        return Registration(T_target_source=None)

class Duck:
    name = "duck"
    def register(self, problem):
        return None

class Helper:
    def register(self, problem): ...

@dataclass
class Record:
    name: str
"""


def plugin(tmp_path, text=PLUGIN, name="my_plugin.py"):
    path = tmp_path / name
    path.write_text(text)
    return path


def asked(*texts):
    return [spec.asked for spec in parse_methods(texts)]


def test_names_are_separated_by_commas_and_brackets_hold_parameters():
    assert asked("icp,fgr", " kiss_icp ") == ["icp", "fgr", "kiss_icp"]
    (spec,) = parse_methods(["icp[ metric = plane , init=prior ]"])
    assert (spec.name, spec.given) == ("icp", (("metric", "plane"), ("init", "prior")))
    assert spec.asked == "icp[metric=plane,init=prior]"


def test_several_values_ask_for_every_combination():
    assert asked("icp[max_distance=0.1,0.5,metric=point,plane],fgr") == [
        "icp[max_distance=0.1,metric=point]",
        "icp[max_distance=0.1,metric=plane]",
        "icp[max_distance=0.5,metric=point]",
        "icp[max_distance=0.5,metric=plane]",
        "fgr",
    ]


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ([], "no method given"),
        ([""], "cannot read method ''"),
        (["icp,,fgr"], "cannot read method ''"),
        (["icp[metric=plane"], "cannot read method"),
        (["icp]"], "cannot read method 'icp]'"),
        (["icp fgr"], "cannot read method 'icp fgr'"),
        (["icp[plane]"], "'plane' is not parameter=value"),
        (["icp[a=1,a=2]"], "parameter 'a' is given twice"),
        (["icp", "fgr,icp"], "method 'icp' is asked for twice"),
        (["icp[a=1,1]"], "method 'icp[a=1]' is asked for twice"),
    ],
)
def test_requests_that_cannot_be_read_are_refused(texts, words):
    with pytest.raises(UserError) as caught:
        parse_methods(texts)
    assert words in str(caught.value)


def test_every_installed_method_loads_and_has_the_name_it_is_listed_by():
    registry = MethodRegistry()
    assert set(names(REGISTRARS)) >= {
        "icp", "gicp", "fgr", "ransac", "kiss_icp", "small_gicp",
        "identity", "random", "oracle", "degenerate", "prior_mean",
    }  # fmt: skip
    for name in registry.names():
        cls, locator = registry.find(name)
        assert cls.name == name
        assert locator.file is None


def test_reading_the_methods_modules_imports_no_heavy_package():
    import subprocess
    import sys

    code = (
        "import sys\nfrom regbench.registry import MethodRegistry\nr = MethodRegistry()\n"
        "[r.find(name) for name in r.names()]\n"
        "print(sorted({'open3d', 'kiss_icp.registration', 'small_gicp', 'torch', 'pandas'} & set(sys.modules)))"
    )
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


def test_a_method_resolves_with_all_its_parameters():
    (spec,) = parse_methods(["icp[preset=paper,max_iterations=7]"])
    method = MethodRegistry().resolve(spec)
    assert method.parameters["max_distance"] == 0.5
    assert method.parameters["max_iterations"] == 7
    assert method.trait("kind") == "classical"
    method.cls(**method.parameters)


def test_an_unknown_method_gets_a_did_you_mean():
    with pytest.raises(UserError, match=r"unknown method 'kis_icp'; did you mean 'kiss_icp'\?"):
        MethodRegistry().find("kis_icp")
    with pytest.raises(UserError, match="unknown protocol 'demo'; did you mean 'demo@1'"):
        find_protocol("demo")


def test_a_plugin_file_gives_every_class_with_a_name_and_register(tmp_path):
    path = plugin(tmp_path)
    assert set(load_plugin(path)) == {"mine", "duck"}
    registry = MethodRegistry([path])
    assert {"mine", "duck", "icp"} <= set(registry.names())
    (spec,) = parse_methods(["mine[distance=0.25]"])
    method = registry.resolve(spec)
    assert method.parameters == {"distance": 0.25}
    assert method.locator.file == str(path.resolve())
    duck = registry.resolve(parse_methods(["duck"])[0])
    assert (duck.trait("kind"), duck.trait("deterministic"), duck.parameters) == ("classical", True, {})


def test_a_plugin_may_import_its_neighbours(tmp_path):
    plugin(tmp_path, "value = 41", "neighbour_of_plugin.py")
    path = plugin(tmp_path, "from neighbour_of_plugin import value\n" + PLUGIN)
    assert "mine" in load_plugin(path)


def test_a_plugins_method_hides_an_installed_one(tmp_path):
    path = plugin(tmp_path, PLUGIN.replace('"mine"', '"icp"'))
    cls, locator = MethodRegistry([path]).find("icp")
    assert cls.__name__ == "Mine"
    assert locator.file is not None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = ", "cannot be imported: SyntaxError"),
        (
            "import no_such_thing_at_all",
            "cannot be imported: ModuleNotFoundError: No module named 'no_such_thing_at_all'",
        ),
        ("raise SystemExit(3)", "cannot be imported: SystemExit: 3"),
        ("x = 1", "no class with a `name` and a `register` method"),
    ],
)
def test_a_broken_plugin_says_why(tmp_path, text, words):
    with pytest.raises(UserError) as caught:
        load_plugin(plugin(tmp_path, text))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_plugins_that_are_missing_or_collide_are_refused(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        load_plugin(tmp_path / "none.py")
    with pytest.raises(UserError, match=r"not a Python file"):
        load_plugin(plugin(tmp_path, name="plugin.txt"))
    first, second = plugin(tmp_path, name="a.py"), plugin(tmp_path, name="b.py")
    with pytest.raises(UserError, match="'mine' is also in"):
        MethodRegistry([first, second])


def test_a_method_that_does_not_import_is_listed_and_says_why(monkeypatch):
    from importlib.metadata import EntryPoint

    from regbench import registry

    broken = EntryPoint("broken", "no_such_module_anywhere:Method", REGISTRARS)
    monkeypatch.setattr(registry, "_entry_points", lambda group: {"broken": broken})
    assert MethodRegistry().names() == ["broken"]
    with pytest.raises(
        UserError, match=r"method 'broken' cannot be loaded from no_such_module_anywhere:Method: Module"
    ):
        load(REGISTRARS, "broken", what="method", listing="")
