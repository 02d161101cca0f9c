"""Advice for meshes in millimetres: the command that converts one to metres, the unit of all other code."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

_CONVERSION = (
    'import sys, trimesh; trimesh.load(sys.argv[1], process=False, force="mesh").apply_scale(0.001).export(sys.argv[2])'
)


def conversion(path: Path | None) -> str:
    """Return advice for a mesh in millimetres: for a file, a shell command that writes it in metres next to it."""
    if path is None:
        return "scale it by 0.001 to metres"
    command = [sys.executable, "-c", _CONVERSION, str(path), str(path.with_name(f"{path.stem}_metres.ply"))]
    return f"convert it: {shlex.join(command)}"
