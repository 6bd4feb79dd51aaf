"""Unpacks zip and tar archives without leaving their folder."""

from __future__ import annotations

import gzip
import lzma
import shutil
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import IO

from regbench.errors import UserError

# What an archive may grow to. Meshes as text shrink about fivefold and images hardly: a bomb is far beyond this.
MAX_GROWTH = 50
MIN_LIMIT_BYTES = 1 << 30
CHUNK_BYTES = 1 << 20
# What zipfile and tarfile raise of broken or encrypted archives, depending on where they break.
BROKEN = (
    zipfile.BadZipFile,
    tarfile.TarError,
    gzip.BadGzipFile,
    lzma.LZMAError,
    zlib.error,
    EOFError,
    RuntimeError,
    ValueError,
    IndexError,  # a member without a name
)


def unpack(path: Path, folder: Path, *, limit_bytes: int | None = None) -> None:
    """Unpack a .zip or .tar[.gz|.xz|.bz2] into a new folder, whole or not at all.

    Zips within it (7-Scenes has one for each sequence) are unpacked where they lie, and removed. Only plain files
    and folders below `folder` are made: links, absolute paths and `..` are refused.

    Args:
        path: The archive.
        folder: Made here; must not exist.
        limit_bytes: Most bytes to write; 50 times the archive's size, and at least 1 GiB, unless given.

    Raises:
        UserError: The archive is broken, holds something that would leave the folder, or grows beyond the limit.
        OSError: The folder cannot be written.
    """
    limit = max(MIN_LIMIT_BYTES, MAX_GROWTH * path.stat().st_size) if limit_bytes is None else limit_bytes
    staging = folder.with_name(f".{folder.name}.unpacking")
    shutil.rmtree(staging, ignore_errors=True)
    staging.mkdir(parents=True)
    try:
        left = _unpack_into(path, staging, path, limit)
        for nested in sorted(staging.rglob("*.zip")):
            left = _unpack_into(nested, nested.parent, path, left)
            nested.unlink()
        staging.rename(folder)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _unpack_into(path: Path, folder: Path, outer: Path, left: int) -> int:
    """Unpack one archive and return how many bytes may still be written."""
    try:
        for name, source in _members(path):
            target = folder / _inside(name, outer)
            if source is None:
                target.mkdir(parents=True, exist_ok=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            with source:
                left = _copy(source, target, outer, left)
    except BROKEN as error:
        raise UserError(f"{outer}: broken archive ({' '.join(str(error).split()) or type(error).__name__})") from None
    return left


def _copy(source: IO[bytes], target: Path, outer: Path, left: int) -> int:
    """Copy a member, counting what really comes: a header may lie."""
    with target.open("xb") as file:  # "x": no member may overwrite another
        while chunk := source.read(CHUNK_BYTES):
            left -= len(chunk)
            if left < 0:
                raise UserError(f"{outer}: unpacks to more than it should; refused as a decompression bomb")
            file.write(chunk)
    return left


def _inside(name: str, outer: Path) -> Path:
    """Return a member's relative path, or refuse one that leaves the folder."""
    pure = PurePosixPath(name.replace("\\", "/"))
    if pure.is_absolute() or ".." in pure.parts or ":" in name or "\0" in name:
        raise UserError(f"{outer}: refused: its member {name!r} would be written outside its folder")
    return Path(*pure.parts)


def _members(path: Path) -> Iterator[tuple[str, IO[bytes] | None]]:
    """Yield each member's name and its content, or None for a folder."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            for info in archive.infolist():
                kind = stat.S_IFMT(info.external_attr >> 16)
                if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
                    raise UserError(f"{path}: refused: its member {info.filename!r} is a link or a device")
                yield info.filename, None if info.is_dir() else archive.open(info)
    elif tarfile.is_tarfile(path):
        with tarfile.open(path) as archive:
            for member in archive:
                if not (member.isfile() or member.isdir()):
                    raise UserError(f"{path}: refused: its member {member.name!r} is a link or a device")
                yield member.name, archive.extractfile(member) if member.isfile() else None
            # To the end: only there does a compressed stream's checksum stand.
            while archive.fileobj is not None and archive.fileobj.read(CHUNK_BYTES):
                pass
    else:
        raise UserError(f"{path}: neither a zip nor a tar archive")
