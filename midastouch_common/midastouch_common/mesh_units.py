"""Advice for meshes in another unit than metres, the unit of all other code."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

_UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254}
_SHORTEST, _LONGEST = 0.01, 0.5  # m; of an object that a finger explores
_CONVERSION = (
    "import sys, trimesh; from midastouch_common.mesh_files import read_triangles; "
    "trimesh.Trimesh(*read_triangles(sys.argv[1]), process=False).apply_scale(float(sys.argv[3])).export(sys.argv[2])"
)


def units_of(extent: float) -> dict[str, float]:
    """Return the units, with their lengths [m], in which an object of this many units is 10 to 500 mm long."""
    return {name: unit for name, unit in _UNITS.items() if _SHORTEST <= extent * unit <= _LONGEST}


def unit_advice(extent: float, path: Path | None = None) -> str:
    """Return advice for a mesh `extent` long that can hardly be in metres: the units that it may be in and the factors.

    For a file it ends with a shell command that writes the mesh in metres next to it, by the first of the factors.
    """
    units = units_of(extent)
    if not units:
        return "no common unit makes it 10 to 500 mm long; export it in metres"
    long = ", ".join(f"in {name} it is {1e3 * extent * unit:.3g} mm long" for name, unit in units.items())
    factors = [f"{unit:g}" for unit in units.values()]
    advice = f"{long}: scale it by {' or '.join(factors)}"
    if path is None:
        return advice
    target = str(path.with_name(f"{path.stem}_metres.ply"))
    return f"{advice}; {shlex.join([sys.executable, '-c', _CONVERSION, str(path), target, factors[0]])}"
