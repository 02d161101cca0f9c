"""Industrial and household parts with flat walls and sharp edges.

The set `cad` has 60 to 160 mm; those of `small_cad` a gel covers in one touch or a few. Nothing may be fitted on them:
they are for judging. Sizes in m, if possible from catalogues of machine elements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_simulation.solids import (
    Layer,
    Outline,
    circle,
    gear_outline,
    lofted,
    mirrored,
    rectangle,
    repeated,
    stacked,
)

Part = Callable[[str], ObjectMesh]
"""Maker of a part: takes its name, returns its mesh."""


def write_parts(parts: Mapping[str, Part], folder: Path) -> list[ObjectMesh]:
    """Write the meshes of all parts, by name, into the folder and return them."""
    meshes = []
    for name, make in parts.items():
        path = folder / f"{name}.ply"
        make(name).save(path)
        meshes.append(ObjectMesh.load(path))
    return meshes


def _flange(name: str, holes: int, plugged: int = 0) -> ObjectMesh:
    """Disc of 100 mm with a hub, a bore and holes on a circle."""
    drilled = repeated(circle(0.007, 0.038, sides=24), holes)[plugged:]
    bore = circle(0.014, sides=72)
    plate, hub = Layer(0.012, (circle(0.05),), (bore, *drilled)), Layer(0.018, (circle(0.023),), (bore,))
    return stacked([plate, hub], name)


def _gear(name: str, teeth: int, holes: int = 0, hub: bool = False, missing: int = 0) -> ObjectMesh:
    """Spur gear of about 90 mm with a bore; holes: for lightening; hub: on one side; missing: number of last teeth."""
    bore = circle(0.009, sides=4 * teeth)
    drilled = repeated(circle(0.004, 0.025, sides=24), holes) if holes else ()
    layers = [Layer(0.014, (gear_outline(teeth, 0.038, 0.045, missing),), (bore, *drilled))]
    if hub:
        layers.append(Layer(0.016, (circle(0.018, sides=4 * teeth),), (bore,)))
    return stacked(layers, name)


def _gear_base(name: str) -> ObjectMesh:
    """Plate with a bearing in the middle, holes at its corners and a block at one end."""
    bore = circle(0.01, sides=72)
    plate = Layer(0.008, (rectangle(0.14, 0.09),), (bore, *_corner_holes(0.058, 0.034)))
    block = rectangle(0.026, 0.03, x=0.05)
    bearing = circle(0.018, sides=72)
    return stacked([plate, Layer(0.008, (bearing, block), (bore,)), Layer(0.006, (bearing,), (bore,))], name)


def _corner_holes(x: float, y: float) -> tuple[np.ndarray, ...]:
    return tuple(circle(0.004, i * x, j * y, sides=24) for i in (-1, 1) for j in (-1, 1))


def _bottle(name: str, sides: int, radius: float) -> ObjectMesh:
    """Body with flat sides, a shoulder that tapers, a round neck with a collar."""
    count = 12 * sides
    corners = circle(radius, sides=sides)
    parts = np.linspace(0, 1, 12, endpoint=False)[:, None]
    polygon = np.concatenate(
        [(1 - parts) * a + parts * b for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
    )
    neck, collar = circle(0.015, sides=count), circle(0.018, sides=count)
    profile = [(polygon, -0.07), (polygon, 0.03), (neck, 0.048), (neck, 0.062), (collar, 0.062), (collar, 0.07)]
    return lofted([np.column_stack([outline, np.full(count, z)]) for outline, z in profile], name)


def _labelled_bottle(name: str) -> ObjectMesh:
    """Six-sided bottle, with steps in place of the shoulder, and a recess for a label on one side."""
    hexagon = circle(0.035, sides=6)
    half = 0.035 * np.cos(np.pi / 6)
    # a recess in the side around 30 deg
    turn = np.array([[np.cos(np.pi / 6), -np.sin(np.pi / 6)], [np.sin(np.pi / 6), np.cos(np.pi / 6)]])
    label = rectangle(0.003, 0.024, x=half) @ turn.T
    body = [Layer(0.025, (hexagon,)), Layer(0.05, (hexagon,), (label,)), Layer(0.025, (hexagon,))]
    neck = [Layer(0.005, (circle(0.024, sides=72),)), Layer(0.02, (circle(0.014, sides=72),))]
    return stacked([*body, *neck], name)


def _carton(name: str, size: tuple[float, float, float], grip: bool = False) -> ObjectMesh:
    """Box; grip: with a recess to grip it by, in the middle of one side."""
    outline, (_, _, height) = rectangle(*size[:2]), size
    if not grip:
        return stacked([Layer(height, (outline,))], name)
    recessed = Layer(0.005, (outline,), (rectangle(0.045, 0.02),))
    return stacked([Layer(height - recessed.thickness, (outline,)), recessed], name)


def _battery_housing(name: str) -> ObjectMesh:
    """Box with cut corners, and on its top two contact blocks at opposite corners."""
    blocks = rectangle(0.02, 0.012, 0.038, 0.018), rectangle(0.02, 0.012, -0.038, -0.018)
    return stacked([Layer(0.024, (rectangle(0.11, 0.064, chamfer=0.006),)), Layer(0.004, blocks)], name)


def _gearbox_housing(name: str) -> ObjectMesh:
    """Box on a flange with four holes, a bearing seat on top."""
    flange = Layer(0.008, (rectangle(0.13, 0.084),), _corner_holes(0.056, 0.033))
    seat = Layer(0.008, (circle(0.02, sides=72),), (circle(0.011, sides=72),))
    return stacked([flange, Layer(0.036, (rectangle(0.088, 0.06),)), seat], name)


def _housing_with_boss(name: str) -> ObjectMesh:
    """Box with cut corners, and a cable entry at one end of its top."""
    body = Layer(0.03, (rectangle(0.11, 0.064, chamfer=0.006),))
    return stacked([body, Layer(0.007, (circle(0.01, x=0.035, sides=48),))], name)


def _shaft(name: str, keyways: int) -> ObjectMesh:
    """Shaft of three steps, 110 mm, with blind keyways in the middle one."""
    ways = repeated(rectangle(0.01, 0.006, x=0.018), keyways)
    sizes = (0.012, 0.035, ()), (0.018, 0.01, ()), (0.018, 0.025, ways), (0.018, 0.01, ()), (0.01, 0.03, ())
    return stacked([Layer(length, (circle(radius, sides=72),), cuts) for radius, length, cuts in sizes], name)


def _bracket_layers() -> list[Layer]:
    """Layers of an L of sheet with three holes, and a rib along the edge of one leg, on one side only."""
    legs = rectangle(0.1, 0.036, 0.0, -0.022), rectangle(0.036, 0.08, -0.032, 0.0)
    holes = tuple(circle(0.0045, x, y, sides=24) for x, y in ((0.035, -0.018), (0.012, -0.018), (-0.032, 0.026)))
    return [Layer(0.006, legs, holes), Layer(0.012, (rectangle(0.1, 0.006, 0.0, -0.037),))]


def _bracket(name: str, right: bool = False) -> ObjectMesh:
    return stacked(mirrored(_bracket_layers()) if right else _bracket_layers(), name)


def _angle_bracket(name: str) -> ObjectMesh:
    """Two equal legs and a web between them, in the middle of their width."""
    legs = rectangle(0.07, 0.008, 0.035, 0.004), rectangle(0.008, 0.07, 0.004, 0.035)
    web = np.array([[0.004, 0.004], [0.052, 0.004], [0.004, 0.052]])
    side = Layer(0.026, legs)
    return stacked([side, Layer(0.008, (*legs, web)), side], name)


def _cone(name: str) -> ObjectMesh:
    rings = [(0.04, -0.045), (0.008, 0.045)]
    return lofted([np.column_stack([circle(radius), np.full(96, z)]) for radius, z in rings], name)


def _disc(name: str, radius: float, height: float, bore: float = 0.0) -> ObjectMesh:
    return stacked([Layer(height, (circle(radius),), (circle(bore),) if bore else ())], name)


CAD_PARTS: dict[str, Part] = {
    "flange_3": partial(_flange, holes=3),
    "flange_4": partial(_flange, holes=4),
    "flange_6": partial(_flange, holes=6),
    "flange_6_plugged": partial(_flange, holes=6, plugged=1),
    "gear_12": partial(_gear, teeth=12, hub=True),
    "gear_17": partial(_gear, teeth=17),
    "gear_24_drilled": partial(_gear, teeth=24, holes=4, hub=True),
    "gear_18_broken": partial(_gear, teeth=18, hub=True, missing=1),
    "gear_base": _gear_base,
    "bottle_4": partial(_bottle, sides=4, radius=0.04),
    "bottle_6": partial(_bottle, sides=6, radius=0.034),
    "bottle_6_labelled": _labelled_bottle,
    "carton": partial(_carton, size=(0.12, 0.08, 0.045)),
    "carton_square": partial(_carton, size=(0.08, 0.08, 0.04)),
    "carton_grip": partial(_carton, size=(0.12, 0.08, 0.045), grip=True),
    "battery_housing": _battery_housing,
    "gearbox_housing": _gearbox_housing,
    "housing_with_boss": _housing_with_boss,
    "shaft_one_key": partial(_shaft, keyways=1),
    "shaft_two_keys": partial(_shaft, keyways=2),
    "bracket_left": _bracket,
    "bracket_right": partial(_bracket, right=True),
    "angle_bracket": _angle_bracket,
    "cylinder": partial(_disc, radius=0.03, height=0.09),
    "cone": _cone,
    "ring": partial(_disc, radius=0.045, height=0.018, bore=0.032),
}
"""Parts by name."""


def _round_peg(name: str) -> ObjectMesh:
    """Dowel of 6 mm, its ends chamfered."""
    profile = [(0.0022, -0.01), (0.003, -0.009), (0.003, 0.009), (0.0022, 0.01)]
    return lofted([np.column_stack([circle(radius, sides=48), np.full(48, z)]) for radius, z in profile], name)


def _prism(name: str, outline: Outline, height: float) -> ObjectMesh:
    return stacked([Layer(height, (outline,))], name)


def _small_gear(name: str, teeth: int, keyed: bool = False) -> ObjectMesh:
    """Gear of 14 mm, with a hub on one side; keyed: with a keyway in its bore."""
    bore = circle(0.002, sides=2 * teeth)
    way = (rectangle(0.0016, 0.0016, x=0.0022),) if keyed else ()
    wheel = Layer(0.004, (gear_outline(teeth, 0.0056, 0.007),), (bore, *way))
    return stacked([wheel, Layer(0.004, (circle(0.0042, sides=4 * teeth),), (bore, *way))], name)


def _plug(name: str, pins: Sequence[Outline]) -> ObjectMesh:
    return stacked([Layer(0.007, (rectangle(0.018, 0.012, chamfer=0.002),)), Layer(0.009, tuple(pins))], name)


def _screw(name: str, drive: Sequence[Outline]) -> ObjectMesh:
    """M5 screw with a flat head of 10 mm, and a drive cut into it."""
    head = circle(0.005, sides=72)
    shank = Layer(0.014, (circle(0.0024, sides=72),))
    return stacked([shank, Layer(0.0025, (head,)), Layer(0.0018, (head,), tuple(drive))], name)


def _keyed_pin(name: str) -> ObjectMesh:
    """Pin of 6 mm, with a collar at one end and a flat at the other."""
    rod, collar = circle(0.003, sides=72), circle(0.0048, sides=72)
    flat = rectangle(0.002, 0.008, x=0.0032)
    return stacked([Layer(0.003, (collar,)), Layer(0.011, (rod,)), Layer(0.006, (rod,), (flat,))], name)


_THREE_PINS = [rectangle(0.003, 0.0012, x, y) for x, y in ((-0.005, -0.003), (0.005, -0.003), (0, 0.003))]
_TWO_PINS = [circle(0.0012, x, sides=24) for x in (-0.0045, 0.0045)]
_SLOT, _CROSS = rectangle(0.012, 0.0014), rectangle(0.006, 0.0014)

SMALL_CAD_PARTS: dict[str, Part] = {
    "round_peg": _round_peg,
    "square_peg": partial(_prism, outline=rectangle(0.006, 0.006), height=0.018),
    "oblong_key": partial(_prism, outline=rectangle(0.006, 0.02), height=0.005),
    "gear_10": partial(_small_gear, teeth=10),
    "gear_16_keyed": partial(_small_gear, teeth=16, keyed=True),
    "two_pin_plug": partial(_plug, pins=_TWO_PINS),
    "three_pin_plug": partial(_plug, pins=_THREE_PINS),
    "slotted_screw": partial(_screw, drive=[_SLOT]),
    "cross_screw": partial(_screw, drive=repeated(_CROSS, 4)[:2]),
    "socket_screw": partial(_screw, drive=[circle(0.004, sides=6)]),
    "keyed_pin": _keyed_pin,
}
"""Parts by name."""
