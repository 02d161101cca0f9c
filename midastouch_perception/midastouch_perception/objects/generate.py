"""Makes the bundled meshes anew: `python -m midastouch_perception.objects.generate`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh

from ..simulation.procedural import (
    at,
    box,
    cylinder,
    difference,
    mesh_from_sdf,
    rippled,
    sphere,
    torus,
    union,
)


def handle_tool() -> ObjectMesh:
    """A 16 cm tool: ribbed grip, collar, hooked head with a jaw, no two parts alike."""
    quarter = np.pi / 2
    grip = rippled(at(cylinder(0.013, 0.045, 0.006), x=-0.035, turn=(0, quarter, 0)), 4e-4, 7e-3, (1.0, 0, 0))
    pommel = at(box((0.010, 0.016, 0.016), 0.004), x=-0.082)
    collar = at(torus(0.015, 0.005), x=0.012, turn=(0, quarter, 0))
    shaft = at(box((0.022, 0.008, 0.0105), 0.002), x=0.030)
    head = at(box((0.018, 0.027, 0.011), 0.003), x=0.062, y=0.006, turn=(0, 0, 0.35))
    jaw = at(box((0.016, 0.006, 0.02), 0.001), x=0.076, y=0.012, turn=(0, 0, 0.35))
    knob = at(sphere(0.007), x=0.056, y=-0.018, z=0.008)
    thumb = at(cylinder(0.006, 0.004, 0.001), x=0.03, z=0.012)
    tool = difference(union(grip, pommel, collar, shaft, head, knob, thumb, blend=0.002), jaw)
    return mesh_from_sdf(tool, np.array([0.1, 0.045, 0.03]), 1.25e-3, "handle_tool")


def ball() -> ObjectMesh:
    """A plain ball of 60 mm: it is the same everywhere, so no answer is the right answer."""
    return mesh_from_sdf(sphere(0.03), np.full(3, 0.032), 1.5e-3, "ball")


def eyebolt() -> ObjectMesh:
    """A 52 mm eyebolt: ring, collar and a threaded shank."""
    ring = at(torus(0.0105, 0.0032), y=0.015, turn=(0, 0, 0))
    collar = at(cylinder(0.0075, 0.0016, 0.0008), y=0.0005, turn=(np.pi / 2, 0, 0))
    rod = at(cylinder(0.0042, 0.0125, 0.0008), y=-0.0125, turn=(np.pi / 2, 0, 0))
    shank = rippled(rod, 2.5e-4, 2.2e-3, (0, 1.0, 0))
    return mesh_from_sdf(union(ring, collar, shank, blend=0.001), np.array([0.016, 0.030, 0.010]), 5e-4, "eyebolt")


def main() -> None:
    """Write the three meshes beside this file."""
    for mesh in (handle_tool(), ball(), eyebolt()):
        mesh.save(Path(__file__).parent / f"{mesh.name}.ply")
        print(f"{mesh.name}: {len(mesh.faces)} faces, {mesh.diagonal * 1e3:.0f} mm across")


if __name__ == "__main__":
    main()
