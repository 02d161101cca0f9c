"""Meshes in millimetres: how to make one in metres of them, which everything else can then use."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

_CONVERSION = (
    'import sys, trimesh; trimesh.load(sys.argv[1], process=False, force="mesh").apply_scale(0.001).export(sys.argv[2])'
)


def conversion(path: Path | None) -> str:
    """What to do with a mesh in millimetres: of a file, the line for a shell that writes it in metres beside it."""
    if path is None:
        return "scale it by 0.001 to metres"
    command = [sys.executable, "-c", _CONVERSION, str(path), str(path.with_name(f"{path.stem}_metres.ply"))]
    return f"convert it: {shlex.join(command)}"
