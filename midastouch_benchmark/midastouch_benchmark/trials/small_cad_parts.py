"""The set `small_cad`: industrial parts that a gel covers in one touch or a few, sharp-edged, with known symmetries.

Sizes in m.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_simulation.solids import (
    Layer,
    Outline,
    circle,
    gear_outline,
    lofted,
    rectangle,
    repeated,
    stacked,
)

from .known_parts import NONE, ROUND, ROUND_BOTH_WAYS, KnownPart, turns, turns_and_flips


def _round_peg(name: str) -> ObjectMesh:
    """Dowel of 6 mm, its ends chamfered."""
    profile = [(0.0022, -0.01), (0.003, -0.009), (0.003, 0.009), (0.0022, 0.01)]
    return lofted([np.column_stack([circle(radius, sides=48), np.full(48, z)]) for radius, z in profile], name)


def _prism(name: str, outline: Outline, height: float) -> ObjectMesh:
    return stacked([Layer(height, (outline,))], name)


def _gear(name: str, teeth: int, keyed: bool = False) -> ObjectMesh:
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

SMALL_CAD_PARTS = {
    "round_peg": KnownPart(_round_peg, ROUND_BOTH_WAYS),
    "square_peg": KnownPart(partial(_prism, outline=rectangle(0.006, 0.006), height=0.018), turns_and_flips(4)),
    "oblong_key": KnownPart(partial(_prism, outline=rectangle(0.006, 0.02), height=0.005), turns_and_flips(2)),
    "gear_10": KnownPart(partial(_gear, teeth=10), turns(10)),
    "gear_16_keyed": KnownPart(partial(_gear, teeth=16, keyed=True), NONE, turns(16)),
    "two_pin_plug": KnownPart(partial(_plug, pins=_TWO_PINS), turns(2)),
    "three_pin_plug": KnownPart(partial(_plug, pins=_THREE_PINS), NONE),
    "slotted_screw": KnownPart(partial(_screw, drive=[_SLOT]), turns(2), ROUND),
    "cross_screw": KnownPart(partial(_screw, drive=repeated(_CROSS, 4)[:2]), turns(4)),
    "socket_screw": KnownPart(partial(_screw, drive=[circle(0.004, sides=6)]), turns(6)),
    "keyed_pin": KnownPart(_keyed_pin, NONE, ROUND),
}
"""Parts by name, each with its known symmetry."""
