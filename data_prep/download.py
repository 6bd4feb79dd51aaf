"""Downloads raw data: mirrors in turn, resumed where cut, checked before anything is unpacked."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from regbench.errors import UserError

from .archive import unpack
from .fetch import IncompleteError, fetch
from .mirrors import DOWNLOADS, Archive

Report = Callable[[str], None]


def get(name: str, data_dir: Path, *, report: Report) -> Path:
    """Download a raw dataset into DATA_DIR/raw/<name>; what is there already is not fetched again.

    Archives are kept in DATA_DIR/downloads until they are unpacked, and parts of them when a connection breaks: the
    same call goes on from there.

    Args:
        name: "modelnet40" (the HDF5 pack), "modelnet40-meshes" or "7scenes".
        data_dir: Folder of prepared datasets.
        report: Called with one line on each step.

    Returns:
        The folder of raw data, to be given to `regbench data prepare`.

    Raises:
        UserError: No mirror gives the archive, its checksum is wrong, or it cannot be unpacked.
    """
    if name not in DOWNLOADS:
        raise UserError(f"no download '{name}'; there are {', '.join(DOWNLOADS)}")
    download = DOWNLOADS[name]
    report(f"licence of {name}: {download.licence}")
    folder = data_dir / "raw" / name
    for archive in download.archives:
        get_archive(archive, data_dir / "downloads", folder, report)
    report(f"next: regbench data prepare {download.prepares} --from {folder} --data {data_dir}")
    return folder


def get_archive(archive: Archive, downloads: Path, folder: Path, report: Report) -> None:
    """Download one archive and unpack it into `folder`/<its name without suffix>; nothing if that is there.

    Raises:
        UserError: As `get`.
    """
    target = folder / Path(archive.file).stem
    if target.exists():
        report(f"{archive.file}: already in {target}")
        return
    path = downloads / archive.file
    try:
        downloads.mkdir(parents=True, exist_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            _from_mirrors(archive, path, report)
        _check(archive, path, report)
        report(f"unpacking {archive.file}")
        unpack(path, target)
        path.unlink()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror or error}") from error


def _from_mirrors(archive: Archive, path: Path, report: Report) -> None:
    """Fetch the archive from the first mirror that gives it whole and right."""
    part = path.with_name(path.name + ".part")
    for url in archive.urls:
        report(f"downloading {url}")
        try:
            # Parts of different mirrors fit together only if a digest will tell in the end.
            fetch(url, part, resume_without_validator=archive.digest is not None, report=report)
        except IncompleteError as error:
            report(f"{url}: {error}")
            continue
        if archive.digest is None or _digest(part, archive.digest) == archive.digest:
            part.rename(path)
            return
        report(f"{url}: the file's checksum is {_digest(part, archive.digest)}, expected {archive.digest}")
        part.unlink()
    raise UserError(
        f"{archive.file}: no mirror gave it ({', '.join(archive.urls)}); "
        f"run the command again to go on, or put the file into {path.parent}"
    )


def _check(archive: Archive, path: Path, report: Report) -> None:
    """Check the archive as it lies on disk, also one that the user put there.

    Raises:
        UserError: Its checksum is wrong.
    """
    if archive.digest is None:
        sha256 = _digest(path, "sha256:")
        report(f"{archive.file}: no published checksum to check it against; what came has {sha256}")
    elif (found := _digest(path, archive.digest)) != archive.digest:
        raise UserError(f"{path}: its checksum is {found}, expected {archive.digest}; delete it and try again")


def _digest(path: Path, like: str) -> str:
    """Return a file's digest as `algorithm:hexadecimal`, by the algorithm that `like` names."""
    algorithm = like.partition(":")[0]
    with path.open("rb") as file:
        return f"{algorithm}:{hashlib.file_digest(file, algorithm).hexdigest()}"
