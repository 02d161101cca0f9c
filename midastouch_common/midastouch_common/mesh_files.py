"""Reading of mesh files by trimesh, and of those that it cannot read or reads wrongly."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import trimesh

from .errors import InputError

_RELATIVE_OR_ZERO = re.compile(rb"^[ \t]*f[ \t](?:[^\n]*[ \t/])?(?:-|0+(?![0-9]))", re.MULTILINE)

_ELEMENTS, _COMMENT = re.compile(rb"^element\s+\S+\s+(\d+)", re.MULTILINE), re.compile(rb"#.*")


def read_triangles(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (V, 3) and faces (F, 3) of a file.

    Raises as trimesh does, and InputError for a cut-off STL, for an OBJ whose faces name missing vertices, and for a
    PLY or OFF in text with another number of lines than its head announces.
    """
    source: Path | io.BytesIO = (path := Path(path))
    _require_lines(path)
    if path.suffix.lower() == ".obj" and _RELATIVE_OR_ZERO.search(path.read_bytes()):
        source = io.BytesIO(_by_absolute_indices(_in_ascii(path), path))
    try:
        loaded = _load(source, path)
    except (UnicodeDecodeError, ImportError):
        # The file has names or comments that are not UTF-8, for which trimesh wants another library. Drop them.
        loaded = _load(io.BytesIO(_in_ascii(path)), path)
    return np.asarray(loaded.vertices, float), np.asarray(loaded.faces)


def _require_lines(path: Path) -> None:
    """Raise InputError unless a PLY or OFF in text has the lines that it announces: trimesh takes what there is."""
    if path.suffix.lower() == ".ply":
        head, _, body = path.read_bytes().partition(b"end_header")
        if b"format ascii" not in head:
            return
        announced = sum(map(int, _ELEMENTS.findall(head)))
    elif path.suffix.lower() == ".off":
        head, _, body = _COMMENT.sub(b"", path.read_bytes()).partition(b"OFF")[2].lstrip().partition(b"\n")
        announced = sum(map(int, head.split()[:2]))
    else:
        return
    lines = sum(1 for line in body.splitlines() if line.strip())
    if lines != announced:
        raise InputError(f"{path}: has {lines} lines of vertices and faces, not {announced}; export or copy it again")


def _load(source: Path | io.BytesIO, path: Path) -> trimesh.Trimesh:
    kind = None if source is path else path.suffix[1:]
    return trimesh.load(source, file_type=kind, process=False, force="mesh")  # type: ignore[return-value] # by `force`


def _in_ascii(path: Path) -> bytes:
    """Return the file's content with `?` for every character of its text that is not ASCII."""
    content, binary = path.read_bytes(), b""
    if path.suffix.lower() == ".ply":
        content, end, binary = content.partition(b"end_header")
        binary = end + binary
    elif path.suffix.lower() == ".stl" and b"facet" not in content:
        raise InputError(f"{path}: cut off, or no STL; export or copy it again")
    return content.decode("ascii", "replace").replace("\ufffd", "?").encode() + binary


def _by_absolute_indices(obj: bytes, path: Path) -> bytes:
    """Return an OBJ whose faces count vertices from the beginning of the file.

    A negative index counts back from the face; trimesh counts it from the end of the file.
    """
    above = {b"v": 0, b"vt": 0, b"vn": 0}

    def absolute(index: bytes, count: int) -> bytes:
        number = int(index or 1)
        if number < -count or number == 0:
            raise InputError(f"{path}: a face names vertex {number} after {count} vertices; export it again")
        return index if number > 0 else b"%d" % (count + 1 + number)

    lines = []
    for line in obj.replace(b"\\\n", b" ").splitlines():
        kind, *corners = line.partition(b"#")[0].split() or [b""]
        if kind in above:
            above[kind] += 1
        if kind == b"f":
            numbers = [map(absolute, corner.split(b"/"), above.values()) for corner in corners]
            line = b"f " + b" ".join(map(b"/".join, numbers))
        lines.append(line)
    return b"\n".join(lines)
