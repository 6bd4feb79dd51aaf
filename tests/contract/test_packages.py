"""What an installed regbench, not a checkout, consists of."""

import configparser
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = {"regbench": "regbench", "regbench_latentcem": "regbench_latentcem"} | {
    "regbench_baselines": "baselines",
    "regbench_data_prep": "data_prep",
}


def test_every_package_is_declared():
    """A package that setup.cfg does not name is there in a checkout and missing in a wheel."""
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    declared = set(setup["options"]["packages"].split())
    there = set()
    for name, folder in FOLDERS.items():
        for file in (ROOT / folder).rglob("__init__.py"):
            there.add(".".join([name, *file.parent.relative_to(ROOT / folder).parts]))
    assert declared == there


def test_what_is_no_python_in_a_package_is_declared():
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    for name, folder in FOLDERS.items():
        for file in (ROOT / folder).rglob("*"):
            if not file.is_file() or file.suffix in {".py", ".pyc", ".md"} or "__pycache__" in file.parts:
                continue
            package = file.parent
            while not (package / "__init__.py").is_file():
                package = package.parent
            dotted = ".".join([name, *package.relative_to(ROOT / folder).parts])
            patterns = setup["options.package_data"].get(dotted, "").split()
            inside = file.relative_to(package)
            assert any(inside.match(pattern) for pattern in patterns), f"{file} would not be installed"
