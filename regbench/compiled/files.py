"""How compiled functions are kept between processes. numba imports it with the first of them; see cache.py.

Where is numba's own choice: NUMBA_CACHE_DIR if set, else `__pycache__` beside the source, else the user's cache folder;
the first that can be written. What numba 0.68 does there does not do for a benchmark:

* A function in one file that calls one in another keeps the other's old code when only the other file has changed. Here
  the sources of both are compared (`_sources_sha256`).
* Processes that compile one function for two signatures change one index file, unlocked. With two in lockstep, 28 of
  300 tries lost an entry, and in 2 the index named the one's code as the other's: a TypeError in every process from
  then on. Here a signature has a file of its own, which says what it is (`KernelFiles`).
* Where nothing can be written, a function with cache=True cannot even be imported. Here it is compiled anew in each
  process.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import pickle
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba

from regbench.compiled.cache import NOWHERE

SEAL_BYTES = hashlib.sha256().digest_size

caching: Any = importlib.import_module("numba.core.caching")  # so imported it is Any: numba's internals have no types


class KernelLocator(caching.InTreeCacheLocator):  # type: ignore[misc]
    """Tells numba the folder for a function's compiled code, and when that code is out of date."""

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> KernelLocator | None:
        """Return a locator, or None for a function whose source is no file."""
        if not Path(py_file).exists():
            return None
        kinds = [caching.UserProvidedCacheLocator, caching.InTreeCacheLocator, caching.UserWideCacheLocator]
        if not Path(kinds[-1](py_func, py_file).get_cache_path()).is_absolute():
            kinds.pop()  # no HOME and no entry in the table of users: it would make a `~` in the current folder
        places = (kind.from_function(py_func, py_file) for kind in kinds)
        locator = cls(py_func, py_file)
        locator._module = py_func.__module__
        locator._cache_path = next((place.get_cache_path() for place in places if place is not None), NOWHERE)
        return locator

    def ensure_cache_path(self) -> None:
        """Make the folder, which may have been deleted since."""
        if self._cache_path != NOWHERE:
            super().ensure_cache_path()

    def get_source_stamp(self) -> str:
        """Return a hash of the sources that the compiled code depends on."""
        return _sources_sha256(self._module, Path(self._py_file).resolve())


@cache
def _sources_sha256(module: str, file: Path) -> str:
    """Return a hash of the sources that a module's compiled functions are made of.

    They are its own and those of the modules that it imports, directly or not, from its package or folder and regbench.
    """
    packages, pending, files = {module.split(".")[0], "regbench"}, [(module, file)], {file}
    while pending:
        importer, path = pending.pop()
        for name in _imported(path, getattr(sys.modules.get(importer), "__package__", None) or ""):
            found = Path(getattr(sys.modules.get(name), "__file__", None) or "").resolve()
            ours = name.split(".")[0] in packages or found.parent == file.parent
            if ours and found.suffix == ".py" and found not in files:
                files.add(found)
                pending.append((name, found))
    return hashlib.sha256(b"".join(sorted(hashlib.sha256(path.read_bytes()).digest() for path in files))).hexdigest()


def _imported(path: Path, package: str) -> Iterator[str]:
    """Yield what may be names of modules among what a source imports first of all: what compiled functions can use."""
    for node in ast.parse(path.read_bytes()).body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


class KernelFiles(caching.IndexDataCacheFile):  # type: ignore[misc]
    """The compiled code of one function: a file for each signature and processor, without an index."""

    def __init__(self, cache_path: str, filename_base: str, source_stamp: str) -> None:
        super().__init__(cache_path, filename_base, source_stamp)
        self._made_of = (numba.__version__, source_stamp)
        self._base = filename_base

    def save(self, key: object, data: object) -> None:
        """Keep code for a key: the signature, the processor, and the function's bytecode."""
        if self._cache_path == NOWHERE:
            return
        kept = self._dump((key, data))
        with self._open_for_write(self._path(key)) as file:  # renamed into place: no reader sees half of it
            file.write(self._seal(kept) + kept)

    def load(self, key: object) -> Any:
        """Return what was kept for a key, or None."""
        try:
            content = self._path(key).read_bytes()
        except OSError:
            return None
        seal, kept = content[:SEAL_BYTES], content[SEAL_BYTES:]
        # Before anything is unpickled: another numba's types may not fit, and damage may raise anything or pass.
        if seal != self._seal(kept):
            return None
        found, data = pickle.loads(kept)
        return data if found == key else None

    def _seal(self, kept: bytes) -> bytes:
        """Return a hash of what is kept, of numba's version and of the sources."""
        return hashlib.sha256(repr(self._made_of).encode() + kept).digest()

    def _path(self, key: object) -> Path:
        return Path(self._cache_path, f"{self._base}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc")


# numba has no setting for the files as it has for the folder. It looks the name up whenever it makes a cache.
caching.IndexDataCacheFile = KernelFiles
