"""Generator of the bundled meshes: `python -m midastouch_simulation.bundled_meshes`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception import objects

from .procedural import Sdf, at, box, cylinder, difference, mesh_from_sdf, rippled, sphere, torus, union


def handle_tool() -> ObjectMesh:
    """Return a 16 cm tool: ribbed grip, collar, hooked head with a jaw, no two parts alike."""
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
    """Return a plain ball of 60 mm: it is the same everywhere, so no pose can be found."""
    return mesh_from_sdf(sphere(0.03), np.full(3, 0.032), 1.5e-3, "ball")


def eyebolt() -> ObjectMesh:
    """Return a 52 mm eyebolt: ring, collar and a threaded shank."""
    ring = at(torus(0.0105, 0.0032), y=0.015, turn=(0, 0, 0))
    collar = at(cylinder(0.0075, 0.0016, 0.0008), y=0.0005, turn=(np.pi / 2, 0, 0))
    rod = at(cylinder(0.0042, 0.0125, 0.0008), y=-0.0125, turn=(np.pi / 2, 0, 0))
    shank = rippled(rod, 2.5e-4, 2.2e-3, (0, 1.0, 0))
    return mesh_from_sdf(union(ring, collar, shank, blend=0.001), np.array([0.016, 0.030, 0.010]), 5e-4, "eyebolt")


def star_knob() -> ObjectMesh:
    """Return a 12 cm knob with a flat back: four arms, each with another section and another end."""

    def along(angle: float, distance: float, shape: Sdf, z: float = 0.0) -> Sdf:
        """Lay the shape's z axis in the direction of an angle [deg] about z."""
        return at(at(shape, x=distance, z=z, turn=(0, np.pi / 2, 0)), turn=(0, 0, np.radians(angle)))

    def end(angle: float, distance: float, shape: Sdf) -> Sdf:
        return at(at(shape, x=distance), turn=(0, 0, np.radians(angle)))

    front = union(
        cylinder(0.016, 0.008, 0.003),
        at(sphere(0.02), x=0.002, y=-0.001, z=-0.005),
        along(0, 0.028, cylinder(0.0085, 0.020, 0.002)),
        along(75, 0.026, cylinder(0.0060, 0.017, 0.001), z=0.001),
        along(160, 0.027, box((0.007, 0.009, 0.018), 0.0015)),
        along(250, 0.028, rippled(cylinder(0.0075, 0.018, 0.002), 3.5e-4, 5e-3, (0, 0, 1.0))),
        end(0, 0.052, sphere(0.012)),
        end(75, 0.048, torus(0.0085, 0.0035)),
        end(160, 0.048, at(box((0.009, 0.012, 0.0085), 0.0008), turn=(0, 0, 0.4))),
        end(250, 0.046, cylinder(0.011, 0.009, 0.001)),
        blend=0.0025,
    )
    back = at(box((0.1, 0.1, 0.02)), z=-0.0265)
    return mesh_from_sdf(difference(front, back), np.array([0.066, 0.066, 0.02]), 1e-3, "star_knob")


def main() -> None:
    """Write the meshes into the perception, which brings them."""
    for mesh in (handle_tool(), ball(), eyebolt(), star_knob()):
        mesh.save(Path(objects.__file__).parent / f"{mesh.name}.ply")
        print(f"{mesh.name}: {len(mesh.faces)} faces, {mesh.diagonal * 1e3:.0f} mm across")


if __name__ == "__main__":
    main()
