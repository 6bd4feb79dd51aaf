"""Hashes that say when a trial has to run again: of a method's source and parameters, and of the trial itself."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import sys
from functools import cache
from pathlib import Path

from regbench.registry import Method

# What a method of any package may lean on; a change there changes its answers too.
SHARED_ROOMS = ("regbench.geometry", "regbench.learning")


def digest(value: object) -> str:
    """Return the SHA-256 of a JSON-like value."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def method_fingerprint(method: Method) -> str:
    """Return a hash of the method's name, version, parameters, source and data files.

    The source is that of its module and of every module it imports, directly or not, from its own package or plugin
    folder and from regbench's shared rooms.
    """
    parts: list[object] = [method.asked, str(method.trait("version")), method.parameters, source_sha256(method)]
    data = data_sha256(method)
    return digest([*parts, data] if data else parts)


def data_sha256(method: Method) -> list[str | None]:
    """Return the SHA-256 of each of the method's data files; None for one that is not there."""
    data_files = getattr(method.cls, "data_files", None)
    if data_files is None:
        return []
    files = data_files(method.cls(**method.parameters))
    return [hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else None for file in files]


def source_sha256(method: Method) -> str:
    """Return the SHA-256 over the sources that the method's answers can depend on."""
    module = sys.modules[method.cls.__module__]
    if method.locator.file is not None:
        roots: tuple[str, ...] = SHARED_ROOMS
        folder: Path | None = Path(method.locator.file).parent
    else:
        roots, folder = (method.cls.__module__.split(".")[0], *SHARED_ROOMS), None
    start = Path(module.__file__) if module.__file__ else None
    files: set[Path] = set()
    pending = [(start, module.__package__ or "")] if start else []
    while pending:
        path, package = pending.pop()
        if path in files or path is None:
            continue
        files.add(path)
        for name in _imported(path, package):
            found = _file_of(name, roots, folder)
            if found is not None and found[0] not in files:
                pending.append(found)
    contents = sorted(hashlib.sha256(path.read_bytes()).hexdigest() for path in files)
    return digest(contents)


@cache
def _imported(path: Path, package: str) -> frozenset[str]:
    """Return the absolute names of all that a file imports, anywhere in it; `from a import b` gives a and a.b."""
    if path.suffix != ".py":
        return frozenset()
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.rsplit(".", node.level - 1)[0] if node.level > 1 else package
            base = ".".join(filter(None, [above if node.level else "", node.module or ""]))
            names.add(base)
            names.update(f"{base}.{alias.name}" for alias in node.names)
    return frozenset(names)


def _file_of(name: str, roots: tuple[str, ...], folder: Path | None) -> tuple[Path, str] | None:
    """Return the file and package of a module if it lies under one of the roots or in the plugin's folder."""
    if folder is not None:
        for candidate in (folder / f"{name.replace('.', '/')}.py", folder / name.replace(".", "/") / "__init__.py"):
            if candidate.is_file():
                return candidate, name if candidate.name == "__init__.py" else name.rpartition(".")[0]
    if not any(name == root or name.startswith(f"{root}.") for root in roots):
        return None
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, AttributeError, ValueError):
        return None  # `from module import function` also asks for module.function, which is no module
    if spec is None or spec.origin is None or not Path(spec.origin).is_file():
        return None
    return Path(spec.origin), name if spec.submodule_search_locations else name.rpartition(".")[0]
