"""The set `small_parts`: parts smaller than the gel, as in a box of screws (paper appendix G).

Sizes in m. Each is a signed distance function turned into a mesh. Threads are rings, since no touch can tell one turn
more or less.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_simulation.procedural import (
    Sdf,
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

_SPACING = 4e-4
_ALONG_X, _ALONG_Y = (0.0, np.pi / 2, 0.0), (np.pi / 2, 0.0, 0.0)
_THREAD = 2e-4, 1.25e-3  # amplitude, pitch


def small_parts(folder: Path) -> list[ObjectMesh]:
    """Return all parts; meshes that the folder lacks are written into it."""
    meshes = []
    for make in _PARTS:
        shape, half = make()
        path = folder / f"{make.__name__}.ply"
        if not path.is_file():
            mesh_from_sdf(shape, np.array(half), _SPACING, make.__name__).save(path)
        meshes.append(ObjectMesh.load(path))
    return meshes


Part = tuple[Sdf, tuple[float, float, float]]
"""A shape and half the sizes of the box that holds it."""


def _hexagon(across_flats: float, half_height: float) -> Sdf:
    """Hexagonal prism around z."""
    angles = np.radians([0, 60, 120])
    normals = np.stack([np.cos(angles), np.sin(angles)])

    def distance(p: np.ndarray) -> np.ndarray:
        return np.maximum(np.abs(p[:, :2] @ normals).max(axis=1) - across_flats / 2, np.abs(p[:, 2]) - half_height)

    return distance


def _threaded(radius: float, half_height: float) -> Sdf:
    """Threaded rod around z, the same from both ends."""
    quarter = _THREAD[1] / 4
    rod = at(cylinder(radius, half_height, 3e-4), z=quarter)
    return at(rippled(rod, *_THREAD, np.array([0.0, 0.0, 1.0])), z=-quarter)


def hex_nut() -> Part:
    """M8: 13 mm across flats."""
    return difference(_hexagon(0.013, 0.00325), _threaded(0.0036, 0.01)), (0.008, 0.008, 0.004)


def hex_bolt() -> Part:
    """M6 x 20."""
    shape = union(at(_hexagon(0.010, 0.002), z=0.012), at(_threaded(0.003, 0.011), z=-0.001))
    return shape, (0.0065, 0.0065, 0.0145)


def cotter_pin() -> Part:
    """25 mm: an eye and two legs, one longer."""
    legs = [at(cylinder(0.0009, h, 4e-4), x, 0, z) for x, h, z in ((-1e-3, 0.011, -6e-3), (1e-3, 9.5e-3, -4.5e-3))]
    return union(at(torus(0.0024, 0.0009), z=0.0065, turn=_ALONG_Y), *legs, blend=3e-4), (0.0045, 0.0025, 0.0185)


def small_eyebolt() -> Part:
    """M5, 25 mm."""
    ring = at(torus(0.005, 0.0016), z=0.0065, turn=_ALONG_Y)
    collar = at(cylinder(0.0038, 0.0008, 3e-4), z=0.0005)
    return union(ring, collar, at(_threaded(0.0024, 0.006), z=-0.006), blend=4e-4), (0.0075, 0.0045, 0.0135)


def hex_key() -> Part:
    """3 mm, legs of 24 and 12 mm."""
    long, short = at(_hexagon(0.003, 0.012), z=0.0), at(_hexagon(0.003, 0.006), x=0.0055, z=-0.0115, turn=_ALONG_X)
    return union(long, short, blend=6e-4), (0.0125, 0.0025, 0.0145)


def nail() -> Part:
    """24 mm, with head and point."""
    taper = _point(0.0012, 0.003)
    shape = union(cylinder(0.0012, 0.0095, 1e-4), at(cylinder(0.0028, 0.0006, 2e-4), z=0.0098), at(taper, z=-0.0095))
    return shape, (0.0035, 0.0035, 0.0135)


def _point(radius: float, length: float) -> Sdf:
    """Cone of a nail's point: from `radius` at 0 to nothing at -length along z."""
    slope = np.array([length, radius]) / np.hypot(length, radius)

    def distance(p: np.ndarray) -> np.ndarray:
        r = np.hypot(p[:, 0], p[:, 1])
        return np.maximum((r - radius) * slope[0] - p[:, 2] * slope[1], p[:, 2])

    return distance


def wing_nut() -> Part:
    """M5, wings of 20 mm."""
    wings = [at(box((0.0035, 0.0011, 0.0035), 8e-4), x, 0, 0.0045, (0.0, tilt, 0.0)) for x, tilt in
             ((0.0065, 0.6), (-0.0065, -0.6))]  # fmt: skip
    body = union(cylinder(0.0045, 0.0032, 5e-4), *wings, blend=6e-4)
    return difference(body, _threaded(0.0022, 0.02)), (0.0115, 0.006, 0.0105)


def ball_stud() -> Part:
    """A ball of 8 mm on an M4 stud with a hexagon."""
    shape = union(
        at(sphere(0.004), z=0.008), cylinder(0.0016, 0.006), at(_hexagon(0.007, 0.0012), z=0.001),
        at(_threaded(0.002, 0.0055), z=-0.0055), blend=3e-4,
    )  # fmt: skip
    return shape, (0.005, 0.005, 0.0135)


_PARTS: tuple[Callable[[], Part], ...] = (
    hex_nut, hex_bolt, cotter_pin, small_eyebolt, hex_key, nail, wing_nut, ball_stud,
)  # fmt: skip
