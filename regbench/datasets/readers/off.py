"""Meshes of ASCII OFF files, as Princeton's ModelNet40 has them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import read_bytes
from regbench.datasets.readers.numbers import parse_numbers
from regbench.errors import UserError

# Some of ModelNet40's files run the counts into the keyword: `OFF700 664 0`. The edge count may be missing.
HEADER = re.compile(rb"\s*OFF\s*(\d{1,18})\s+(\d{1,18})(?:[ \t]+\d+)?[ \t\r]*(?:\n|$)")
COMMENT = re.compile(rb"#[^\n]*")


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: (V, 3) float64.
        faces: (F, 3) int64 indices into the vertices; polygons are split into fans.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def read_off(path: Path) -> Mesh:
    """Return the mesh of an OFF file.

    Raises:
        UserError: The file cannot be read, is truncated, or holds anything but finite vertices and faces of them.
    """
    content = COMMENT.sub(b"", read_bytes(path))
    header = HEADER.match(content)
    if header is None:
        raise UserError(f"{path}: not an ASCII OFF file (no 'OFF' with the counts of vertices and faces)")
    vertex_count, face_count = int(header[1]), int(header[2])
    body = content[header.end() :]
    if 6 * vertex_count > len(body) + 1 or 2 * face_count > len(body) + 1:  # "0 0 0\n" and "0\n" at least
        raise UserError(f"{path}: truncated: it claims {vertex_count} vertices and {face_count} faces")
    vertices, faces = _triangles(path, body, vertex_count, face_count) or _polygons(
        path, body, vertex_count, face_count
    )
    if not np.isfinite(vertices).all():
        raise UserError(f"{path}: {(~np.isfinite(vertices)).any(axis=1).sum()} vertices are not finite")
    if (faces < 0).any() or (faces >= vertex_count).any():
        raise UserError(f"{path}: a face names a vertex that is not there (it has {vertex_count})")
    return Mesh(vertices, faces)


_Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]


def _triangles(path: Path, body: bytes, vertex_count: int, face_count: int) -> _Arrays | None:
    """Return vertices and faces of the usual file, one item a line and all faces triangles; else None.

    Split at the line where the faces start, they are parsed as whole numbers, which takes a fraction of the time.
    """
    line_ends = np.flatnonzero(np.frombuffer(body, np.uint8) == ord("\n"))
    if not 0 < vertex_count <= len(line_ends):
        return None
    split = line_ends[vertex_count - 1] + 1
    try:
        vertices = parse_numbers(path, body[:split])
        faces = parse_numbers(path, body[split:], np.int64)
    except UserError:
        return None
    if len(vertices) != 3 * vertex_count or len(faces) != 4 * face_count or (faces[::4] != 3).any():
        return None
    return vertices.reshape(-1, 3), faces.reshape(-1, 4)[:, 1:]


def _polygons(path: Path, body: bytes, vertex_count: int, face_count: int) -> _Arrays:
    """Return vertices and faces of any other file: polygons, colours, empty lines."""
    numbers = parse_numbers(path, body)
    if len(numbers) < 3 * vertex_count + face_count:
        raise UserError(f"{path}: truncated: it claims {vertex_count} vertices and {face_count} faces")
    faces = _fans(path, body, vertex_count, face_count)
    if not np.isfinite(faces).all() or (faces % 1 != 0).any() or (np.abs(faces) > vertex_count).any():
        raise UserError(f"{path}: a face names a vertex that is not there (it has {vertex_count})")
    return numbers[: 3 * vertex_count].reshape(-1, 3), faces.astype(np.int64)


def _fans(path: Path, body: bytes, vertex_count: int, face_count: int) -> NDArray[np.float64]:
    """Return triangles of polygons, one polygon a line; what follows the indices on a line is a colour."""
    lines = [line for line in body.splitlines() if line.strip()]
    triangles: list[tuple[float, float, float]] = []
    if len(lines) < vertex_count + face_count:
        raise UserError(f"{path}: truncated: {len(lines)} lines for {vertex_count} vertices and {face_count} faces")
    for line in lines[vertex_count : vertex_count + face_count]:
        size, *rest = (float(word) for word in line.split())
        if not (size.is_integer() and 0 <= size <= len(rest)):
            raise UserError(f"{path}: a face lists fewer vertices than it claims")
        corners = rest[: int(size)]
        triangles += [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
    return np.array(triangles, dtype=np.float64).reshape(-1, 3)
