"""Points of PLY files: ascii, binary little and big endian."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import checked_points, read_bytes
from regbench.datasets.readers.numbers import parse_numbers
from regbench.errors import UserError

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Element:
    """Properties are (name, type), or (name, type of the count, type of the items) for a list."""

    name: str
    count: int
    properties: list[tuple[str, ...]] = field(default_factory=list)

    def dtype(self, path: Path, byte_order: str) -> np.dtype[np.void]:
        if any(len(item) != 2 for item in self.properties):
            raise UserError(f"{path}: the element '{self.name}' has list properties, which are not supported here")
        names = [item[0] for item in self.properties]
        if len(set(names)) != len(names):
            raise UserError(f"{path}: the element '{self.name}' names a property twice")
        return np.dtype([(name, byte_order + kind) for name, kind in self.properties])


def read_ply(path: Path, *, drop_invalid: bool = False) -> NDArray[np.float64]:
    """Return x, y, z of the element `vertex`, (N, 3) float64. Other properties and elements are passed over.

    Raises:
        UserError: The file cannot be read, is no PLY, is truncated, or its points are not finite.
    """
    content = read_bytes(path)
    if not re.match(rb"ply\s*\n", content):
        raise UserError(f"{path}: not a PLY file")
    end = re.search(rb"\nend_header[ \t]*\r?\n", content)
    if end is None:
        raise UserError(f"{path}: truncated: its header has no end")
    byte_order, elements = _parse_header(path, content[: end.start()])
    before: list[_Element] = []
    for element in elements:
        if element.name == "vertex":
            break
        before.append(element)
    else:
        raise UserError(f"{path}: has no element 'vertex'")
    dtype = element.dtype(path, byte_order)
    if not {"x", "y", "z"} <= set(dtype.names or ()):
        raise UserError(f"{path}: its vertices have no x, y and z")
    read = _read_binary if byte_order else _read_ascii
    columns = read(path, content[end.end() :], before, element, dtype)
    return checked_points(path, columns, drop_invalid=drop_invalid)


def _parse_header(path: Path, header: bytes) -> tuple[str, list[_Element]]:
    byte_order = None
    elements: list[_Element] = []
    for line in header.decode("latin-1").split("\n")[1:]:
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, _] if name in BYTE_ORDERS:
                byte_order = BYTE_ORDERS[name]
            case ["element", name, count] if re.fullmatch(r"[0-9]{1,18}", count):
                elements.append(_Element(name, int(count)))
            case ["property", "list", size, kind, name] if elements and size in TYPES and kind in TYPES:
                elements[-1].properties.append((name, TYPES[size], TYPES[kind]))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append((name, TYPES[kind]))
            case _:
                raise UserError(f"{path}: cannot read the header line {line.strip()[:80]!r}")
    if byte_order is None:
        raise UserError(f"{path}: its header does not say the format")
    return byte_order, elements


def _read_ascii(
    path: Path, body: bytes, before: list[_Element], vertex: _Element, dtype: np.dtype[np.void]
) -> NDArray[np.float64]:
    """Each element is a line."""
    lines = [line for line in body.split(b"\n") if line.strip()]
    skipped = sum(element.count for element in before)
    rows = lines[skipped : skipped + vertex.count]
    names = dtype.names or ()
    numbers = parse_numbers(path, b"\n".join(rows))
    if len(rows) < vertex.count:
        raise UserError(f"{path}: truncated: {len(rows)} of {vertex.count} points are there")
    if len(numbers) != vertex.count * len(names):
        raise UserError(f"{path}: truncated, or a point does not have {len(names)} numbers")
    table = numbers.reshape(vertex.count, len(names))
    columns: NDArray[np.float64] = table[:, [names.index(axis) for axis in "xyz"]]
    return columns


def _read_binary(
    path: Path, body: bytes, before: list[_Element], vertex: _Element, dtype: np.dtype[np.void]
) -> NDArray[np.float64]:
    order = ">" if dtype["x"].byteorder == ">" else "<"
    offset = sum(element.count * element.dtype(path, order).itemsize for element in before)
    there = max(len(body) - offset, 0) // dtype.itemsize
    if there < vertex.count:
        raise UserError(f"{path}: truncated: {there} of {vertex.count} points are there")
    table = np.frombuffer(body, dtype, vertex.count, offset) if vertex.count else np.empty(0, dtype)
    return np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)
