"""Test protocols of `midastouch benchmark`, by name: the slides or grasps, the events on the way, and the starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from midastouch_common.errors import InputError
from midastouch_simulation.slide import Leap

from . import disturbances
from .cache import Cache, SlideKind
from .camera_faults import CameraFaultCache
from .disturbances import Disturbance
from .grasps import HOLDS, PINCHED, GraspCache, GraspRecord, PinchCache, grasp, pinch
from .other_shapes import OtherShapeCache
from .real_sensor import RealSensorCache
from .yardstick import Yardstick

NEXT = "next"
"""Value of `Protocol.foreign`: foreign touches are those of the next object of the campaign."""
PLAIN = "plain"
PAPER, UNIFORM = "paper", "uniform"

_SHORT = SlideKind(first=0.3)
"""Slides for faults that last all the time; by far long enough to converge."""
_EVENT = 0.27
"""Length [m] of slides with an event: 60 frames to converge from a narrow start (after 40 half of the filters have
not), then the event, and 120 frames to recover."""
_NARROW = 0.2  # of the paper's start


@dataclass(frozen=True)
class Protocol:
    """Test protocol. summary: for tables; disturb: changes the frames; slides: their kind; starts; beta: width of the
    paper's start; foreign: the bundled object whose touches are mixed in, by name, or NEXT; objects: by default;
    make_cache: of slides as its sensors see them; codebook_size: poses; record: makes an `Observer` whose result is
    added to the trial; real_gel: whether the images are those of real gel."""

    summary: str
    disturb: Disturbance = disturbances.plain
    slides: SlideKind = field(default_factory=SlideKind)
    starts: tuple[str, ...] = (PAPER,)
    beta: float = 1.0
    foreign: str | None = None
    objects: tuple[str, ...] = ()
    make_cache: Callable[..., Cache] = Cache
    codebook_size: int = 50_000
    record: Callable[[Yardstick], GraspRecord] | None = None
    real_gel: bool = False


def _event(summary: str, disturb: Disturbance, leap: Leap | None = None, foreign: str | None = None) -> Protocol:
    """Return a protocol whose event happens at a certain frame to a filter that has converged."""
    slides = SlideKind(first=_EVENT) if leap is None else SlideKind(_EVENT, leap)
    return Protocol(summary, disturb, slides, beta=_NARROW, foreign=foreign)


PROTOCOLS = {
    PLAIN: Protocol("nothing is wrong"),
    "uniform": Protocol("nothing known at the start", starts=(UNIFORM,)),
    "tool_bias": Protocol("tool 2 mm, 2 deg off", disturbances.tool_bias, _SHORT),
    "late": Protocol("poses 50 ms late", disturbances.late, _SHORT),
    "slow_camera": Protocol("every image comes twice", disturbances.slow_camera, _SHORT),
    "rest": _event("at rest in contact for 20 s", disturbances.rest),
    "lift": _event("lifted 20 mm, put down 50 mm away", disturbances.lift, Leap(0.05)),
    "kidnap": _event("lifted; the object is moved by 50 mm, unreported", disturbances.kidnap, Leap(0.05)),
    "jump": _event("30 mm, 175 deg in one step", disturbances.jump, Leap(0.03, np.radians(175.0))),
    "unexplained": _event("12 touches that nothing explains", disturbances.unexplained, foreign="eyebolt"),
    "push": _event("the object is pushed by 5 mm, 5 deg", disturbances.push),
    "wrong_mesh": Protocol(
        "another object is touched (always wrong)", disturbances.wrong_mesh, _SHORT, (UNIFORM,), foreign=NEXT
    ),
    "other_shape": Protocol(
        "the object differs a little from its mesh",
        slides=SlideKind(0.3),
        starts=(UNIFORM,),
        make_cache=OtherShapeCache,
    ),
    "real_sensor": Protocol("seen by two real sensors", make_cache=RealSensorCache, real_gel=True),
    "real_sensor_calibrated": Protocol(
        "... each calibrated", make_cache=partial(RealSensorCache, calibrated=True), real_gel=True
    ),
    "camera_faults": Protocol(
        "faults of cameras, lamps and gels",
        slides=SlideKind(0.3),
        make_cache=CameraFaultCache,
        codebook_size=10_000,
        real_gel=True,
    ),
    "small_parts": Protocol(
        "parts smaller than the gel", slides=SlideKind(0.075), objects=("small_parts",), codebook_size=10_000
    ),
    "grasp": Protocol(
        "held still by a thumb and two fingers",
        grasp,
        SlideKind(grasp="grasp"),
        (UNIFORM,),
        make_cache=GraspCache,
        record=partial(GraspRecord, times=HOLDS),
    ),
    "pinch": Protocol(
        "pinched three times by two fingers",
        pinch,
        SlideKind(grasp="pinch"),
        (UNIFORM,),
        make_cache=PinchCache,
        record=partial(GraspRecord, times=PINCHED),
    ),
}


def chosen_protocol(name: str) -> Protocol:
    """Return the protocol of that name; InputError for an unknown one."""
    if name not in PROTOCOLS:
        raise InputError(f"--protocol {name}: not known; there are {', '.join(PROTOCOLS)}")
    return PROTOCOLS[name]
