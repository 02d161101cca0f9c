"""Symmetries of the parts made by code, which are known by construction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_perception.symmetry.group import Symmetry, about

_ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class Known:
    """exact: all motions that map a part onto itself; near: those after which most of it is the same (the exact ones
    among them), None if the exact ones are all."""

    exact: Symmetry
    near: Symmetry | None = None


NONE = Symmetry()
ROUND = Symmetry(free="axis")
ROUND_BOTH_WAYS = Symmetry(about(_ORIGIN, np.stack([np.eye(3), np.diag([1.0, -1, -1])])), "axis")
"""Symmetries of parts that are alike after any turn about z; the latter also after a half turn across z."""


def turns(count: int) -> Symmetry:
    """Return the turns about z by multiples of 1 / count of a circle."""
    return Symmetry(about(_ORIGIN, _about_z(count)))


def turns_and_flips(count: int) -> Symmetry:
    """Return the turns of `turns`, and half turns across z, the first of them about x."""
    rotations = _about_z(count)
    return Symmetry(about(_ORIGIN, np.concatenate([rotations, rotations @ np.diag([1.0, -1, -1])])))


def half_turn(axis: tuple[float, float, float]) -> Symmetry:
    """Return the half turn about an axis through the origin."""
    direction = np.array(axis) / np.linalg.norm(axis)
    return Symmetry(about(_ORIGIN, np.stack([np.eye(3), 2 * np.outer(direction, direction) - np.eye(3)])))


def _about_z(count: int) -> np.ndarray:
    angles = 2 * np.pi * np.arange(count) / count
    return Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()


KNOWN = {
    "flange_3": Known(turns(3)),
    "flange_4": Known(turns(4)),
    "flange_6": Known(turns(6)),
    "flange_6_plugged": Known(NONE, turns(6)),
    "gear_12": Known(turns(12)),
    "gear_17": Known(turns_and_flips(17)),
    "gear_24_drilled": Known(turns(4), turns(24)),
    "gear_18_broken": Known(NONE, turns(18)),
    "gear_base": Known(NONE, turns(2)),
    "bottle_4": Known(turns(4)),
    "bottle_6": Known(turns(6)),
    "bottle_6_labelled": Known(NONE, turns(6)),
    "carton": Known(turns_and_flips(2)),
    "carton_square": Known(turns_and_flips(4)),
    "carton_grip": Known(turns(2), turns_and_flips(2)),
    "battery_housing": Known(turns(2)),
    "gearbox_housing": Known(turns(2)),
    "housing_with_boss": Known(NONE, turns(2)),
    "shaft_one_key": Known(NONE, ROUND),
    "shaft_two_keys": Known(turns(2), ROUND),
    "bracket_left": Known(NONE),
    "bracket_right": Known(NONE),
    "angle_bracket": Known(half_turn((1, 1, 0))),
    "cylinder": Known(ROUND_BOTH_WAYS),
    "cone": Known(ROUND),
    "ring": Known(ROUND_BOTH_WAYS),
    "round_peg": Known(ROUND_BOTH_WAYS),
    "square_peg": Known(turns_and_flips(4)),
    "oblong_key": Known(turns_and_flips(2)),
    "gear_10": Known(turns(10)),
    "gear_16_keyed": Known(NONE, turns(16)),
    "two_pin_plug": Known(turns(2)),
    "three_pin_plug": Known(NONE),
    "slotted_screw": Known(turns(2), ROUND),
    "cross_screw": Known(turns(4)),
    "socket_screw": Known(turns(6)),
    "keyed_pin": Known(NONE, ROUND),
}
"""Symmetries by the name of the part."""
