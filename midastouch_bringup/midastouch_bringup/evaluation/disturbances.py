"""Test protocols beside the plain one: what real arms and real work do to a slide.

Each takes the frames of a trial and returns those of the disturbed one; only what the filter is told differs, except
for rests and slow cameras, which repeat frames, and a kidnapping, which also leaves frames out.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from midastouch_filter.filter import Measurement
from midastouch_perception import se3
from midastouch_perception.errors import InputError

from .trial import TrialFrame

FRAME_TIME = 0.05
"""s between frames of a simulated slide: 1.5 mm apart at 30 mm/s."""

_BIAS_T, _BIAS_R = 2e-3, np.radians(2.0)
_DELAY = 0.05  # s
_KIDNAP = 0.05  # m
_LIFTED = 10  # frames
_HEIGHT = 0.02  # m
_MOVING, _RESTING = 40, 20  # frames
_REST_T, _REST_R = 2e-5, np.radians(0.02)  # sigma per axis of an arm's joints at rest
_CODE_NOISE = 0.01  # length of a code's change by the camera's noise

Disturbance = Callable[[list[TrialFrame], np.random.Generator], list[TrialFrame]]


def tool_bias(frames: list[TrialFrame], rng: np.random.Generator) -> list[TrialFrame]:
    """A wrong hand-eye calibration: the same 2 mm and 2 deg, in a random direction, on every measured pose."""
    directions = rng.standard_normal((2, 3))
    directions *= np.array([[_BIAS_T], [_BIAS_R]]) / np.linalg.norm(directions, axis=1, keepdims=True)
    bias = se3.exp(directions.reshape(6))
    return [dataclasses.replace(frame, measured=frame.measured @ bias) for frame in frames]


def time_offset(frames: list[TrialFrame], rng: np.random.Generator) -> list[TrialFrame]:
    """Clocks that disagree: each image gets the arm's pose of 50 ms before."""
    measured = np.array([frame.measured for frame in frames])
    late = np.maximum(np.arange(len(frames)) - _DELAY / FRAME_TIME, 0)
    low = np.floor(late).astype(int)
    high = np.minimum(low + 1, len(frames) - 1)
    step = se3.log(se3.inverse(measured[low]) @ measured[high])
    delayed = measured[low] @ se3.exp((late - low)[:, None] * step)
    return [dataclasses.replace(frame, measured=pose) for frame, pose in zip(frames, delayed, strict=True)]


def lift(frames: list[TrialFrame], rng: np.random.Generator) -> list[TrialFrame]:
    """Half-way the arm lifts the sensor and puts it down 50 mm away, which the odometry tells."""
    return _moved_away(frames, told=True)


def kidnap(frames: list[TrialFrame], rng: np.random.Generator) -> list[TrialFrame]:
    """Half-way the sensor is lifted, and the object is moved 50 mm before the next touch: nothing tells the filter."""
    return _moved_away(frames, told=False)


def rest(frames: list[TrialFrame], rng: np.random.Generator) -> list[TrialFrame]:
    """Every 2 s the arm stops for one: poses and codes then differ by the noise of joints and camera only."""
    out = []
    for i, frame in enumerate(frames, start=1):
        out.append(frame)
        if i % _MOVING == 0:
            out += [_at_rest(frame, rng) for _ in range(_RESTING)]
    return out


def slow_camera(frames: list[TrialFrame], rng: np.random.Generator) -> list[TrialFrame]:
    """Every image comes twice, the second time half-way to where the next one is taken."""
    out = [frames[0]]
    for frame, following in pairwise(frames):
        half = {
            name: getattr(frame, name) @ se3.exp(0.5 * se3.log(se3.inverse(getattr(frame, name)) @ pose))
            for name, pose in (("measured", following.measured), ("truth", following.truth))
        }
        out += [dataclasses.replace(frame, ms={}, **half), following]
    return out


def _at_rest(frame: TrialFrame, rng: np.random.Generator) -> TrialFrame:
    felt, noise = frame.felt, rng.standard_normal(6) * np.repeat([_REST_T, _REST_R], 3)
    if felt.code is not None:
        change = rng.standard_normal(len(felt.code)) * _CODE_NOISE / np.sqrt(len(felt.code))
        felt = dataclasses.replace(felt, code=(felt.code + change).astype(np.float32))
    return dataclasses.replace(frame, felt=felt, measured=frame.measured @ se3.exp(noise))


def _moved_away(frames: list[TrialFrame], told: bool) -> list[TrialFrame]:
    """The first half, frames without contact in which the sensor goes up and down again, and the rest from the first
    frame 50 mm away; without one, the farthest."""
    last = frames[len(frames) // 2]
    rest = frames[len(frames) // 2 + 1 :]
    if not rest:
        raise InputError(f"a slide of {len(frames)} frames is too short to lift the sensor; give a longer one")
    distance = np.linalg.norm([f.truth[:3, 3] - last.truth[:3, 3] for f in rest[: len(rest) // 2 + 1]], axis=1)
    far = int(np.argmax(distance >= _KIDNAP)) if (distance >= _KIDNAP).any() else int(np.argmax(distance))
    after = rest[far:]
    jump = np.eye(4) if told else last.measured @ se3.inverse(after[0].measured)
    air = Measurement(in_contact=False)
    heights = [_HEIGHT * min(k, _LIFTED - k) / (_LIFTED // 2) for k in range(1, _LIFTED + 1)]
    lifted = [
        dataclasses.replace(last, felt=air, ms={}, measured=last.measured @ up, truth=last.truth @ up)
        for up in (se3.make(np.eye(3), np.array([0.0, 0.0, height])) for height in heights)
    ]
    return [
        *frames[: len(frames) // 2 + 1],
        *lifted,
        *(dataclasses.replace(frame, measured=jump @ frame.measured) for frame in after),
    ]


DISTURBANCES: dict[str, Disturbance] = {
    "tool_bias": tool_bias,
    "time_offset": time_offset,
    "rest": rest,
    "slow_camera": slow_camera,
    "lift": lift,
    "kidnap": kidnap,
}
PLAIN = "plain"
