"""Symmetries of the parts made by code, which are known by construction."""

import numpy as np

from midastouch_common import se3
from midastouch_perception.symmetry.group import Symmetry

FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # half a turn about x


def turns(count: int, flips: bool = False) -> Symmetry:
    """The turns about z by multiples of 1 / count of a circle and, with flips, half turns across z, one about x."""
    about_z = se3.exp(2 * np.pi / count * np.arange(count)[:, None] * [0.0, 0, 0, 0, 0, 1])
    return Symmetry(np.concatenate([about_z, about_z @ FLIP]) if flips else about_z)


ROUND, ROUND_BOTH_WAYS = Symmetry(free="axis"), Symmetry(np.stack([np.eye(4), FLIP]), "axis")
DIAGONAL = Symmetry(np.stack([np.eye(4), np.eye(4)[[1, 0, 2, 3]] * [1, 1, -1, 1]]))  # half a turn about (1, 1, 0)
_EXACT = (
    (Symmetry(), "flange_6_plugged gear_18_broken gear_base bottle_6_labelled housing_with_boss shaft_one_key"),
    (Symmetry(), "bracket_left bracket_right gear_16_keyed three_pin_plug keyed_pin"),
    (turns(2), "carton_grip battery_housing gearbox_housing shaft_two_keys two_pin_plug slotted_screw"),
    (turns(3), "flange_3"),
    (turns(4), "flange_4 gear_24_drilled bottle_4 cross_screw"),
    (turns(6), "flange_6 bottle_6 socket_screw"),
    (turns(10), "gear_10"),
    (turns(12), "gear_12"),
    (turns(2, flips=True), "carton oblong_key"),
    (turns(4, flips=True), "carton_square square_peg"),
    (turns(17, flips=True), "gear_17"),
    (DIAGONAL, "angle_bracket"),
    (ROUND, "cone"),
    (ROUND_BOTH_WAYS, "cylinder ring round_peg"),
)
_NEAR = (
    (turns(2), "gear_base housing_with_boss"),
    (turns(2, flips=True), "carton_grip"),
    (turns(6), "flange_6_plugged bottle_6_labelled"),
    (turns(16), "gear_16_keyed"),
    (turns(18), "gear_18_broken"),
    (turns(24), "gear_24_drilled"),
    (ROUND, "shaft_one_key shaft_two_keys slotted_screw keyed_pin"),
)
EXACT = {name: group for group, names in _EXACT for name in names.split()}
"""All motions that map a part onto itself, by its name."""
NEAR = {name: group for group, names in _NEAR for name in names.split()}
"""Those after which most of it is the same, the exact ones among them, if these are not all."""
