"""Finds methods, trainables, datasets, protocols and more by entry point, lazily, and the first two in files.

Nothing is imported before it is asked for by name. What cannot be imported is reported with its reason.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regbench.errors import UserError
from regbench.parameters import resolve
from regbench.suggest import unknown

if TYPE_CHECKING:
    from regbench.datasets.dataset import Dataset
    from regbench.protocols.protocol import Protocol

REGISTRARS, TRAINABLES, PROTOCOLS, DATASETS, PREPARATIONS, DOWNLOADS, PLOTS, REPRODUCTIONS = (
    "regbench.registrars",
    "regbench.trainables",
    "regbench.protocols",
    "regbench.datasets",
    "regbench.preparations",
    "regbench.downloads",
    "regbench.plots",
    "regbench.reproductions",
)


@dataclass(frozen=True)
class MethodSpec:
    """One method as it was asked for: `name[key=value,...]`, one value per key."""

    asked: str
    name: str
    given: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Locator:
    """Where a method's class is found again, in another process: a module or a plugin file, and the class's name."""

    module: str | None
    file: str | None
    attribute: str


@dataclass(frozen=True)
class Method:
    """A method found and resolved: its class, every parameter's value, and where a worker finds it.

    Attributes:
        asked: The name as it was asked for, which is how tables call it.
        cls: The class; duck-typed, so read its optional attributes by `trait`.
        parameters: Every constructor parameter's value.
        locator: For the worker.
    """

    asked: str
    cls: type
    parameters: dict[str, object]
    locator: Locator

    def trait(self, name: str) -> Any:
        """Return an optional class attribute of the contract, or the contract's default."""
        from regbench.contract import Registrar

        return getattr(self.cls, name, getattr(Registrar, name))

    def missing(self) -> list[str]:
        """Return the modules of `requires` that are not installed."""
        return [module for module in self.trait("requires") if not _is_installed(module)]


def _is_installed(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):  # of a.b, already a is not there
        return False


def parse_methods(texts: Iterable[str]) -> list[MethodSpec]:
    """Read method requests: names separated by commas, each with optional `[key=value,value2,key2=value]`.

    Several values of one key ask for several methods, one for each combination.

    Raises:
        UserError: The text does not follow the grammar, or names the same method twice.
    """
    specs = [spec for item in split_names(texts) or [] for spec in _parse_method(item)]
    if not specs:
        raise UserError("no method given; `regbench ls methods` lists them")
    twice = {spec.asked for spec in specs if sum(other.asked == spec.asked for other in specs) > 1}
    if twice:
        raise UserError(f"method '{min(twice)}' is asked for twice")
    return specs


def split_names(texts: Iterable[str] | None) -> list[str] | None:
    """Split requests at commas outside brackets; `pairs:DIR` is left whole, for a folder's name may hold commas."""
    if texts is None:
        return None
    return [
        name.strip()
        for text in texts
        for name in ([text] if text.startswith("pairs:") else re.split(r",(?![^\[]*\])", text))
    ]


def _parse_method(text: str) -> list[MethodSpec]:
    match = re.fullmatch(r"([A-Za-z0-9_.\-]+)(?:\[([^\[\]]*)\])?", text)
    if match is None:
        raise UserError(
            f"cannot read method '{text}'; write name or name[parameter=value,...], "
            "the name in letters, digits, '_', '.' and '-'"
        )
    name, inside = match.groups()
    values: dict[str, list[str]] = {}
    key = None
    for token in (inside or "").split(",") if inside else []:
        if "=" in token:
            key, _, value = (part.strip() for part in token.partition("="))
            if key in values:
                raise UserError(f"method '{text}': parameter '{key}' is given twice")
            values[key] = [value]
        elif key is None:
            raise UserError(f"method '{text}': '{token.strip()}' is not parameter=value")
        else:
            values[key].append(token.strip())
    combinations: list[tuple[tuple[str, str], ...]] = [()]
    for key, options in values.items():
        combinations = [(*head, (key, option)) for head in combinations for option in options]
    return [
        MethodSpec(f"{name}[{','.join(f'{k}={v}' for k, v in given)}]" if given else name, name, given)
        for given in combinations
    ]


@cache
def _entry_points(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in sorted(entry_points(group=group), key=lambda point: point.name)}


def names(group: str) -> list[str]:
    """Return the names known to a group, importing nothing."""
    return list(_entry_points(group))


def load(group: str, name: str, *, what: str, listing: str) -> Any:
    """Import what an entry point names.

    Raises:
        UserError: The name is unknown (with a did-you-mean), or importing it fails (with the reason).
    """
    points = _entry_points(group)
    if name not in points:
        raise UserError(unknown(what, name, points, listing=listing))
    try:
        return points[name].load()
    except (Exception, SystemExit) as error:
        raise UserError(f"{what} '{name}' cannot be loaded from {points[name].value}: {_reason(error)}") from error


def _reason(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def load_plugin(path: Path) -> dict[str, type]:
    """Import a plugin file and return its methods by name: every class with a `name` and a `register` method.

    Raises:
        UserError: The file is missing, does not import, or holds no method.
    """
    methods = _named_classes(path, "register")
    if not methods:
        raise UserError(f"plugin {path}: no class with a `name` and a `register` method")
    return methods


def _named_classes(path: Path, *methods: str) -> dict[str, type]:
    """Import a plugin file and return its own classes that have a `name` and these methods, by name."""
    module = import_file(path)
    return {
        vars(cls).get("name", getattr(cls, "name", None)): cls
        for cls in vars(module).values()
        if inspect.isclass(cls)
        and cls.__module__ == module.__name__
        and isinstance(getattr(cls, "name", None), str)
        and all(callable(getattr(cls, method, None)) for method in methods)
    }


def import_file(path: Path) -> Any:
    """Import a Python file under a name of its own (its folder joins sys.path, as for a script).

    Raises:
        UserError: The file is missing or does not import.
    """
    if not path.is_file():
        raise UserError(f"plugin {path}: no such file")
    path = path.resolve()
    name = f"regbench_plugin_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise UserError(f"plugin {path}: not a Python file (expected a name ending in .py)")
    module = importlib.util.module_from_spec(spec)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise UserError(f"plugin {path} cannot be imported: {_reason(error)}") from error
    return module


class MethodRegistry:
    """Methods by name: those installed, and those of the plugin files given."""

    def __init__(self, plugins: Sequence[Path] = ()) -> None:
        self._classes: dict[str, tuple[type, Path]] = {}
        self.broken: dict[str, str] = {}
        for path in plugins:
            for name, cls in load_plugin(path).items():
                if name in self._classes:
                    raise UserError(f"plugin {path}: method '{name}' is also in {self._classes[name][1]}")
                self._classes[name] = (cls, path)

    def names(self) -> list[str]:
        """Return every method's name; a plugin file's method hides an installed one of the same name."""
        return sorted({*names(REGISTRARS), *self._classes})

    def find(self, name: str) -> tuple[type, Locator]:
        """Return a method's class and where a worker finds it.

        Raises:
            UserError: Unknown name, or it does not import.
        """
        if name in self._classes:
            cls, path = self._classes[name]
            return cls, Locator(None, str(path.resolve()), cls.__qualname__)
        if name not in names(REGISTRARS):
            raise UserError(unknown("method", name, self.names(), listing="`regbench ls methods`"))
        cls = load(REGISTRARS, name, what="method", listing="`regbench ls methods`")
        if not (inspect.isclass(cls) and callable(getattr(cls, "register", None))):
            raise UserError(f"method '{name}': {_entry_points(REGISTRARS)[name].value} is not a class with `register`")
        return cls, Locator(cls.__module__, None, cls.__qualname__)

    def resolve(self, spec: MethodSpec) -> Method:
        """Return the method of a request, with every parameter's value.

        Raises:
            UserError: Unknown method, parameter or preset, or a value of the wrong type.
        """
        cls, locator = self.find(spec.name)
        return Method(spec.asked, cls, resolve(cls, dict(spec.given), spec.name), locator)


class TrainableRegistry:
    """What can be trained (regbench.learning.training.trainable), by name: installed, and in the plugin files given."""

    def __init__(self, plugins: Sequence[Path] = ()) -> None:
        self._classes: dict[str, type] = {}
        for path in plugins:
            found = _named_classes(path, "network", "sample", "losses", "validate")
            if not found:
                raise UserError(f"plugin {path}: no Trainable with a `name`")
            self._classes |= found

    def names(self) -> list[str]:
        """Return every name; a plugin file's hides an installed one."""
        return sorted({*names(TRAINABLES), *self._classes})

    def find(self, name: str) -> type:
        """Return the class of a name.

        Raises:
            UserError: Unknown name, or it does not import.
        """
        if name in self._classes:
            return self._classes[name]
        if name not in names(TRAINABLES):
            raise UserError(unknown("trainable method", name, self.names()))
        cls: type = load(TRAINABLES, name, what="trainable method", listing="`regbench weights ls`")
        return cls


def open_dataset(name: str, data_dir: Path) -> Dataset:
    """Open a dataset by name.

    Raises:
        UserError: Unknown name, or not prepared in `data_dir`.
    """
    dataset: Dataset = load(DATASETS, name, what="dataset", listing="`regbench ls datasets`")(data_dir)
    return dataset


def find_protocol(text: str) -> Protocol:
    """Return the protocol of an id such as `demo@1`, or `pairs:DIR` for a user's own pairs.

    Raises:
        UserError: Unknown id.
    """
    if text.startswith("pairs:"):
        from regbench.protocols.pairs import PairsProtocol

        return PairsProtocol.of_folder(Path(text.removeprefix("pairs:")))
    protocol: Protocol = load(PROTOCOLS, text, what="protocol", listing="`regbench ls protocols`")
    return protocol
