"""The test protocols of `midastouch benchmark`, by name: what is slid over, what happens on the way, how it starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.simulation.slide import Leap

from . import disturbances
from .cache import Cache, SlideKind
from .disturbances import Disturbance
from .grasps import GraspCache, GraspRecord, grasp
from .real_sensor import RealSensorCache
from .trial import RIGHT, Yardstick

NEXT = "next"
"""Foreign touches are those of the next object of the campaign."""
PLAIN = "plain"
PAPER, UNIFORM = "paper", "uniform"

_SHORT = SlideKind(length=0.3)
"""Long enough to converge by far: what goes wrong then goes wrong all the time."""
_EVENT = SlideKind(length=0.27)
"""60 frames to converge from a narrow start (after 40 half of the filters have not); then the event, and 120 to find
back."""
_NARROW = 0.2  # of the paper's start


@dataclass(frozen=True)
class Protocol:
    """summary, for tables; disturb, what is done to the frames; slides, their kind; starts, and beta, width of the
    paper's; foreign, name of the bundled object, or NEXT, whose touches are mixed in; small_parts, whether they are
    touched in place of the campaign's objects; make_cache, of slides as its sensors see them; codebook_size, poses;
    right [m], how near a pose must be to the truth; modulo_symmetry, as of `Yardstick`; record, of what a trial is
    asked on its way."""

    summary: str
    disturb: Disturbance = disturbances.plain
    slides: SlideKind = field(default_factory=SlideKind)
    starts: tuple[str, ...] = (PAPER,)
    beta: float = 1.0
    foreign: str | None = None
    small_parts: bool = False
    make_cache: Callable[..., Cache] = Cache
    codebook_size: int = 50_000
    right: float = RIGHT
    modulo_symmetry: bool = False
    record: Callable[[Yardstick], GraspRecord] | None = None

    def describe(self) -> dict:
        """What of it a result depends on, for keys and JSON, beside slides and starts, which options can change."""
        return {"foreign": self.foreign, "right_m": self.right, "twins": self.modulo_symmetry}


def _event(summary: str, disturb: Disturbance, leap: Leap | None = None, foreign: str | None = None) -> Protocol:
    """One that happens at a certain frame to a filter that has converged."""
    return Protocol(summary, disturb, SlideKind(_EVENT.length, leap), beta=_NARROW, foreign=foreign)


PROTOCOLS = {
    PLAIN: Protocol("nothing is wrong"),
    "uniform": Protocol("nothing known at the start", starts=(UNIFORM,)),
    "tool_bias": Protocol("tool 2 mm, 2 deg off", disturbances.tool_bias, _SHORT),
    "late": Protocol("poses 50 ms late", disturbances.late, _SHORT),
    "slow_camera": Protocol("every image comes twice", disturbances.slow_camera, _SHORT),
    "rest": _event("the arm rests in contact for 20 s", disturbances.rest),
    "lift": _event("lifted 20 mm, put down 50 mm away", disturbances.lift, Leap(0.05)),
    "kidnap": _event("the same, untold", disturbances.kidnap, Leap(0.05)),
    "jump": _event("30 mm, 175 deg in one step", disturbances.jump, Leap(0.03, np.radians(175.0))),
    "unexplained": _event("12 touches that nothing explains", disturbances.unexplained, foreign="eyebolt"),
    "push": _event("the object is pushed by 5 mm, 5 deg", disturbances.push),
    "wrong_mesh": Protocol("another object is touched", disturbances.wrong_mesh, _SHORT, (UNIFORM,), foreign=NEXT),
    "real_sensor": Protocol("seen by real sensors", make_cache=RealSensorCache),
    "real_sensor_calibrated": Protocol("... each calibrated", make_cache=partial(RealSensorCache, calibrated=True)),
    "small_parts": Protocol(
        "parts smaller than the gel",
        slides=SlideKind(0.075),
        small_parts=True,
        codebook_size=10_000,
        right=0.004,
        modulo_symmetry=True,
    ),
    "grasp": Protocol(
        "grasped without sliding, by four fingers",
        grasp,
        SlideKind(grasps=4),
        (UNIFORM,),
        make_cache=GraspCache,
        modulo_symmetry=True,
        record=GraspRecord,
    ),
}


def chosen_protocol(name: str) -> Protocol:
    """The protocol of that name; InputError for an unknown one."""
    if name not in PROTOCOLS:
        raise InputError(f"--protocol {name}: not known; there are {', '.join(PROTOCOLS)}")
    return PROTOCOLS[name]
