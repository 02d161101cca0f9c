"""Force of an arm on its gel: without bias and weight, and compared with the depth that images show.

A camera sees the gel, and late. The arm's own sensor feels at once what no image shows: an object that meets the rim of
the gel or the housing. Forces act on the gel, along the axes of its frame: one that pushes the gel off the object is
positive along z.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from midastouch_common.errors import InputError

GEL_STIFFNESS = 1e8
"""Pressure of a gel per depth [Pa/m]: that of soft silicone, 0.2 MPa, over a layer of 2 mm."""
HEAVIEST = 20.0
"""Largest mass of a tool [kg]: more than the payload of most arms."""
_GRAVITY = 9.81  # m/s^2
_FRICTION = 1.2  # largest coefficient of silicone on an object
_WINDOW = 0.1  # s, over which the bias and the direction of a push are averaged
_ENOUGH = 3  # samples in it
_SURE = 0.25  # of the margin, the error of an average
_KEPT, _TURNS = 128, 16  # samples, places in the air
_SAME_TURN, _TURNED = 0.01, 0.1  # squared changes of direction: that of no turn; sum over turns that weigh a tool


@dataclass(frozen=True)
class ForceModel:
    """What a measured force consists of. mass [kg]: of the tool, as far as the arm does not subtract its weight itself;
    stiffness [Pa/m]: pressure of the gel per depth; margin [N]: error of the arm's forces, which is no contact. Raises
    InputError for values that cannot be."""

    mass: float = 0.0
    stiffness: float = GEL_STIFFNESS
    margin: float = 4.0

    def __post_init__(self) -> None:
        if not 0 <= self.mass <= HEAVIEST:
            raise InputError(f"tool mass: {self.mass:g} kg is not between 0 and {HEAVIEST:g}")
        for name, value in (("stiffness", self.stiffness), ("margin", self.margin)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} of forces: {value:g} is not a positive number")


class Sample(NamedTuple):
    """Measured force: stamp [s]; force (3,) [N] on the tool, and up (3,), the direction against gravity, along the
    gel's axes."""

    stamp: float
    force: np.ndarray
    up: np.ndarray


class Mismatch(NamedTuple):
    """Contact that a force does not fit: problem, empty if it does; sure, whether no newer image can explain it."""

    problem: str = ""
    sure: bool = True


class Wrench:
    """Force on a gel. Without samples it finds no problem. Arg: model."""

    def __init__(self, model: ForceModel):
        self._model = model
        self._samples: deque[Sample] = deque(maxlen=_KEPT)
        self._bias: np.ndarray | None = None
        self._in_the_air: deque[Sample] = deque(maxlen=_TURNS)

    def take(self, sample: Sample) -> None:
        """Take a sample, newer than those before."""
        self._samples.append(sample)

    @property
    def force(self) -> np.ndarray:
        """Newest force (3,) [N] on the gel; with the bias as long as that is not known, and zero before any sample."""
        if not self._samples:
            return np.zeros(3)
        bias = np.zeros(3) if self._bias is None else self._bias
        return self._without_weight(self._samples[-1]) - bias

    @property
    def mass(self) -> float | None:
        """Mass of the tool [kg] that forces in the air show; None before the tool was turned by about 30 deg."""
        if len(self._in_the_air) < 2:
            return None
        forces, ups = (np.array(each) for each in list(zip(*self._in_the_air, strict=True))[1:])
        forces, ups = forces - forces.mean(axis=0), ups - ups.mean(axis=0)
        turned = float(np.square(ups).sum())
        return None if turned < _TURNED else -float((forces * ups).sum()) / (_GRAVITY * turned)

    def tare(self) -> str:
        """Take the newest forces for the bias, because nothing touches; return why that is not possible yet. Without
        any sample nothing is taken."""
        if not self._samples:
            return ""
        if len(recent := self._recent()) < _ENOUGH:
            return f"fewer than {_ENOUGH} forces in {1e3 * _WINDOW:.0f} ms: their bias is not known"
        force, up = (np.median(each, axis=0) for each in list(zip(*recent, strict=True))[1:])
        air = Sample(recent[-1].stamp, force, up)
        self._bias = self._without_weight(air)
        if self._in_the_air and np.square(self._in_the_air[-1].up - up).sum() < _SAME_TURN:
            self._in_the_air.pop()
        self._in_the_air.append(air)
        return ""

    def compared(self, displaced: float, slope: float) -> Mismatch:
        """Compare the newest force with a contact in an image: displaced [m^3], largest volume of the object in the
        gel, 0 if nothing touches; slope of the touched surface."""
        if self._bias is None:
            return Mismatch()
        margin, pushes = self._model.margin, self._model.stiffness * displaced
        normal, across = float(self.force[2]), math.hypot(*self.force[:2])
        averaged = float(np.mean([self._without_weight(each)[2] for each in self._recent()]) - self._bias[2])
        pulls = normal < -margin or (averaged < -_SURE * margin and pushes > 2 * _SURE * margin)
        drags = across > margin + (_FRICTION + slope) * max(normal, 0.0)
        if not (pulls or drags or normal > margin + pushes):
            return Mismatch()
        force = f"a force of {across:.1f} N across the gel and {normal:.1f} onto it"
        if not pushes:
            mass = "" if self.mass is None else f", {self.mass:.2f} kg by turns in the air"
            meaning = f"but no image shows a contact: something touches beside the gel, or tool_mass is wrong{mass}"
        elif pulls:
            meaning = "but it is pressed: the sign or the frame of the wrench is wrong"
        else:
            meaning = f"of which its depth explains {pushes:.1f}: its rim touches something"
        return Mismatch(f"{force}, {meaning}", sure=pulls or drags)

    def describe(self) -> dict[str, str]:
        """Return values for diagnostics: the force, and the mass of the tool."""
        if not self._samples:
            return {"force": "none comes: an object at the gel's rim is noticed late, by images only"}
        newest = f"{np.linalg.norm(self.force):.1f} N"
        bias = "unknown" if self._bias is None else f"{np.linalg.norm(self._bias):.1f} N"
        mass = "unknown before a turn" if self.mass is None else f"{self.mass:.2f}"
        return {"force": f"{newest}, bias {bias}", "tool_mass_kg": mass}

    def _recent(self) -> list[Sample]:
        return [each for each in self._samples if each.stamp > self._samples[-1].stamp - _WINDOW]

    def _without_weight(self, sample: Sample) -> np.ndarray:
        return sample.force + self._model.mass * _GRAVITY * sample.up
