"""Points of PCD files (Point Cloud Library): ascii, binary and binary_compressed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import checked_points, read_bytes
from regbench.datasets.readers.lzf import MAX_INFLATION, decompress
from regbench.datasets.readers.numbers import parse_numbers
from regbench.errors import UserError

TYPES = {"F": "f", "I": "i", "U": "u"}
_Fields = list[tuple[str, np.dtype[np.void]]]


def read_pcd(path: Path, *, drop_invalid: bool = False) -> NDArray[np.float64]:
    """Return the fields x, y, z of a PCD file, (N, 3) float64. The viewpoint is not applied.

    Organised clouds of depth cameras hold NaN where the camera saw nothing: `drop_invalid` leaves these out.

    Raises:
        UserError: The file cannot be read, is no PCD, is truncated, or its points are not finite.
    """
    content = read_bytes(path)
    data = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", content, re.MULTILINE)
    if data is None:
        raise UserError(f"{path}: not a PCD file (no DATA line)")
    header = _parse_header(path, content[: data.start()])
    fields = _fields(path, header)
    count = _whole(path, "POINTS", header.get("POINTS", []))
    body, kind = content[data.end() :], data[1].decode()
    if kind == "ascii":
        columns = _read_ascii(path, body, fields, count)
    elif kind == "binary":
        columns = _read_binary(path, body, fields, count)
    elif kind == "binary_compressed":
        columns = _read_compressed(path, body, fields, count)
    else:
        raise UserError(f"{path}: unknown DATA '{kind}', expected ascii, binary or binary_compressed")
    return checked_points(path, columns, drop_invalid=drop_invalid)


def _parse_header(path: Path, header: bytes) -> dict[str, list[str]]:
    entries = {}
    for line in header.decode("latin-1").split("\n"):
        key, *values = line.split("#")[0].split() or [""]
        entries[key] = values
    if "FIELDS" not in entries:
        raise UserError(f"{path}: not a PCD file (no FIELDS line)")
    return entries


def _whole(path: Path, key: str, words: list[str]) -> int:
    if len(words) != 1 or not re.fullmatch(r"[0-9]{1,18}", words[0]):
        raise UserError(f"{path}: its header's {key} is not one whole number")
    return int(words[0])


def _fields(path: Path, header: dict[str, list[str]]) -> _Fields:
    """Return each field's name and type; a field of several numbers has a type with a shape."""
    names = header["FIELDS"]
    sizes, kinds = header.get("SIZE", []), header.get("TYPE", [])
    counts = header.get("COUNT", ["1"] * len(names))
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise UserError(f"{path}: its header's FIELDS, SIZE, TYPE and COUNT differ in length")
    fields: _Fields = []
    for name, size, kind, count in zip(names, sizes, kinds, counts, strict=True):
        known = size in ("1", "2", "4", "8") and kind in TYPES and not (kind == "F" and size in "12")
        if not known or not re.fullmatch(r"[0-9]{1,6}", count):
            raise UserError(f"{path}: field {name!r} has an unknown type ({kind}{size}, count {count})")
        fields.append((name, np.dtype((f"<{TYPES[kind]}{size}", (int(count),)))))
    for axis in "xyz":
        found = [dtype.shape for name, dtype in fields if name == axis]
        if found != [(1,)]:
            raise UserError(f"{path}: needs one field '{axis}' of one number")
    return fields


def _read_ascii(path: Path, body: bytes, fields: _Fields, count: int) -> NDArray[np.float64]:
    numbers = parse_numbers(path, body)
    starts = np.cumsum([0, *(dtype.shape[0] for _, dtype in fields)])
    if len(numbers) < count * starts[-1]:
        raise UserError(f"{path}: truncated: {len(numbers) // starts[-1]} of {count} points are there")
    table = numbers[: count * starts[-1]].reshape(count, starts[-1])
    places = dict(zip((name for name, _ in fields), starts, strict=False))
    columns: NDArray[np.float64] = table[:, [places[axis] for axis in "xyz"]]
    return columns


def _read_binary(path: Path, body: bytes, fields: _Fields, count: int) -> NDArray[np.float64]:
    # By position: padding fields are all called `_`.
    dtype = np.dtype([(f"{position}", kind) for position, (_, kind) in enumerate(fields)])
    if len(body) < count * dtype.itemsize:
        raise UserError(f"{path}: truncated: {len(body) // dtype.itemsize} of {count} points are there")
    table = np.frombuffer(body, dtype, count) if count else np.empty(0, dtype)
    names = [name for name, _ in fields]
    return np.stack([table[f"{names.index(axis)}"][:, 0].astype(np.float64) for axis in "xyz"], axis=1)


def _read_compressed(path: Path, body: bytes, fields: _Fields, count: int) -> NDArray[np.float64]:
    """Decompress; the fields then follow one another, each for all points."""
    size = count * sum(dtype.itemsize for _, dtype in fields)
    packed, unpacked = (int(number) for number in np.frombuffer(body[:8].ljust(8, b"\0"), "<u4"))
    if len(body) - 8 < packed or unpacked != size or unpacked > MAX_INFLATION * packed:
        raise UserError(f"{path}: truncated, or its compressed sizes do not fit {count} points")
    try:
        content = decompress(body[8 : 8 + packed], size)
    except ValueError as error:
        raise UserError(f"{path}: {error}") from None
    columns, offset = {}, 0
    for name, dtype in fields:
        columns[name] = np.frombuffer(content, dtype.base, count * dtype.shape[0], offset)
        offset += count * dtype.itemsize
    return np.stack([columns[axis].astype(np.float64) for axis in "xyz"], axis=1)
