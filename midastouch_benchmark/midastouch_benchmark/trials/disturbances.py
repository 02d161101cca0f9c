"""Disturbances of a slide by real arms, hands and work: each takes a scene and returns the disturbed frames.

Only the filter's inputs differ, except that rests, lifts and slow cameras add frames, and that a touch of the wrong
object has no truth. Lift, kidnap and jump need a slide with a `Leap`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.touch import Measurement
from midastouch_perception.codebook import Codebook

from .trial import FRAME_TIME, Event, TrialFrame

_BIAS_T, _BIAS_R = 2e-3, np.radians(2.0)
_DELAY = 0.05  # s
_LIFTED = 10  # frames
_HEIGHT = 0.02  # m
_RESTING = 400  # frames, 20 s
_REST_T, _REST_R = 2e-5, np.radians(0.02)  # sigma per axis of an arm's joints at rest
_CODE_NOISE = 0.01  # length of a code's change by the camera's noise
_PUSH_T, _PUSH_R = 5e-3, np.radians(5.0)
_PUSHED = 5  # frames, 20 mm/s
_UNEXPLAINED = 12  # frames


@dataclass(frozen=True)
class UndisturbedSlide:
    """Slide to disturb. frames; rng; foreign: frames of a slide over another object; codebook: of the slide's own
    object; both only for disturbances that need them."""

    frames: list[TrialFrame]
    rng: np.random.Generator
    foreign: list[TrialFrame] = field(default_factory=list)
    codebook: Codebook | None = None

    @property
    def middle(self) -> int:
        """Position of the frame at which an event happens: after a third, like the slide's `Leap`."""
        if len(self.frames) < 3:
            raise InputError(f"a slide of {len(self.frames)} frames is too short to disturb it; give a longer one")
        return len(self.frames) // 3


@dataclass(frozen=True)
class Disturbed:
    """Disturbed slide. frames: of the trial; event: None if nothing happens at a certain frame."""

    frames: list[TrialFrame]
    event: Event | None = None


Disturbance = Callable[[UndisturbedSlide], Disturbed]


def plain(scene: UndisturbedSlide) -> Disturbed:
    """Leave the slide undisturbed."""
    return Disturbed(scene.frames)


def tool_bias(scene: UndisturbedSlide) -> Disturbed:
    """Use a wrong hand-eye calibration: the same 2 mm and 2 deg, in a random direction, on every measured pose."""
    bias = _random_motion(scene.rng, _BIAS_T, _BIAS_R)
    return Disturbed([dataclasses.replace(frame, measured=frame.measured @ bias) for frame in scene.frames])


def late(scene: UndisturbedSlide) -> Disturbed:
    """Let clocks disagree: each image gets the arm's pose of 50 ms before."""
    return Disturbed(delayed(scene.frames, np.full(len(scene.frames), _DELAY / FRAME_TIME)))


def delayed(frames: list[TrialFrame], by: np.ndarray) -> list[TrialFrame]:
    """Return frames with the arm's poses of earlier moments; by: (N,) frames, negative for later ones."""
    measured, last = np.array([frame.measured for frame in frames]), len(frames) - 1
    when = np.clip(np.arange(len(frames)) - by, 0, last)
    low = np.floor(when).astype(int)
    step = se3.log(se3.inverse(measured[low]) @ measured[np.minimum(low + 1, last)])
    poses = measured[low] @ se3.exp((when - low)[:, None] * step)
    return [dataclasses.replace(frame, measured=pose) for frame, pose in zip(frames, poses, strict=True)]


def jump(scene: UndisturbedSlide) -> Disturbed:
    """Let the slide leap; the odometry reports it."""
    k = _leap(scene)
    return Disturbed(scene.frames, Event(k, k))


def lift(scene: UndisturbedSlide) -> Disturbed:
    """Lift the sensor and put it down where the slide leaps to; the odometry reports it."""
    return _moved_away(scene, reported=True)


def kidnap(scene: UndisturbedSlide) -> Disturbed:
    """Lift the sensor and move the object before the next touch, which is not reported to the filter."""
    return _moved_away(scene, reported=False)


def push(scene: UndisturbedSlide) -> Disturbed:
    """Push the object by 5 mm and 5 deg under contact, within 5 frames; the arm's poses do not show it.

    With D the object's motion in the base, about the contact, the arm is at D T_obj_gel.
    """
    frames, start = scene.frames, scene.middle
    about = se3.translation(frames[start].truth[:3, 3])
    whole = se3.log(_random_motion(scene.rng, _PUSH_T, _PUSH_R))
    pushed = [
        about @ se3.exp(whole * np.clip((k - start + 1) / _PUSHED, 0, 1)) @ se3.inverse(about)
        for k in range(len(frames))
    ]
    moved = [dataclasses.replace(f, measured=d @ f.measured) for f, d in zip(frames, pushed, strict=True)]
    return Disturbed(moved, Event(start, min(start + _PUSHED, len(frames) - 1)))


def unexplained(scene: UndisturbedSlide) -> Disturbed:
    """Replace 12 consecutive touches by those of another object's slide that the codebook explains least."""
    frames, start = scene.frames, scene.middle
    touches = _least_explained(scene.foreign, scene.codebook, min(_UNEXPLAINED, len(frames) - start - 1))
    strange = [dataclasses.replace(f, measurement=each) for f, each in zip(frames[start:], touches, strict=False)]
    end = start + len(strange)
    return Disturbed([*frames[:start], *strange, *frames[end:]], Event(start, end))


def wrong_mesh(scene: UndisturbedSlide) -> Disturbed:
    """Touch another object, on which no pose is true."""
    nowhere = np.full((4, 4), np.nan)
    return Disturbed([dataclasses.replace(frame, truth=nowhere) for frame in scene.foreign])


def rest(scene: UndisturbedSlide) -> Disturbed:
    """Stop the arm in contact for 20 s: poses and codes then differ by the noise of joints and camera only."""
    frames, k = scene.frames, scene.middle
    still = [at_rest(frames[k], scene.rng) for _ in range(_RESTING)]
    return Disturbed([*frames[: k + 1], *still, *frames[k + 1 :]], Event(k + 1, k + 1 + _RESTING))


def slow_camera(scene: UndisturbedSlide) -> Disturbed:
    """Send every image twice, the second time half-way to where the next one is taken."""
    out = scene.frames[:1]
    for frame, following in pairwise(scene.frames):
        half = {
            name: getattr(frame, name) @ se3.exp(0.5 * se3.log(se3.inverse(getattr(frame, name)) @ pose))
            for name, pose in (("measured", following.measured), ("truth", following.truth))
        }
        seconds = 0.5 * following.seconds if following.seconds else None
        out += [
            dataclasses.replace(frame, ms={}, seconds=seconds, **half),
            dataclasses.replace(following, seconds=seconds),
        ]
    return Disturbed(out)


def _random_motion(rng: np.random.Generator, translation: float, rotation: float) -> np.ndarray:
    """Return a motion (4, 4) by `translation` [m] in a random direction and `rotation` [rad] about a random axis."""
    directions = rng.standard_normal((2, 3))
    directions *= np.array([[translation], [rotation]]) / np.linalg.norm(directions, axis=1, keepdims=True)
    return se3.exp(directions.reshape(6))


def at_rest(frame: TrialFrame, rng: np.random.Generator) -> TrialFrame:
    """Return a frame again, its codes and its measured pose with the noise of camera and joints."""
    measurement, noise = _seen_again(frame.measurement, rng), rng.standard_normal(6) * np.repeat([_REST_T, _REST_R], 3)
    others = {name: _seen_again(each, rng) for name, each in frame.others.items()}
    return dataclasses.replace(frame, measurement=measurement, measured=frame.measured @ se3.exp(noise), others=others)


def _seen_again(measurement: Measurement, rng: np.random.Generator) -> Measurement:
    if measurement.code is None:
        return measurement
    change = rng.standard_normal(len(measurement.code)) * _CODE_NOISE / np.sqrt(len(measurement.code))
    return dataclasses.replace(measurement, code=(measurement.code + change).astype(np.float32))


def _leap(scene: UndisturbedSlide) -> int:
    """Return the position of the first frame after the slide's longest step, of those around the middle."""
    around = range(max(scene.middle - 1, 1), scene.middle + 2)
    truth = [frame.truth[:3, 3] for frame in scene.frames]
    return max(around, key=lambda k: np.linalg.norm(truth[k] - truth[k - 1]))


def _moved_away(scene: UndisturbedSlide, reported: bool) -> Disturbed:
    """Insert frames without contact, in which the sensor goes up and down again, before the slide's leap."""
    k = _leap(scene)
    before, after = scene.frames[:k], scene.frames[k:]
    last = before[-1]
    jump = np.eye(4) if reported else last.measured @ se3.inverse(after[0].measured)
    air = Measurement(in_contact=False)
    heights = [_HEIGHT * min(k, _LIFTED - k) / (_LIFTED // 2) for k in range(1, _LIFTED + 1)]
    lifted = [
        dataclasses.replace(last, measurement=air, ms={}, measured=last.measured @ up, truth=last.truth @ up)
        for up in (se3.translation([0.0, 0.0, height]) for height in heights)
    ]
    moved = [dataclasses.replace(frame, measured=jump @ frame.measured) for frame in after]
    return Disturbed([*before, *lifted, *moved], Event(k, k + _LIFTED))


def _least_explained(foreign: list[TrialFrame], codebook: Codebook, n: int) -> list[Measurement]:
    """Return the n consecutive touches whose best matches in the codebook are the worst, by the mean cosine of their
    codes; InputError if there are not n in a row."""
    codes = codebook.codes / np.linalg.norm(codebook.codes, axis=1, keepdims=True)
    best = np.array([_best_cosine(frame.measurement, codes) for frame in foreign])
    if len(best) < n or not np.isfinite(means := np.convolve(best, np.full(n, 1 / n), "valid")).any():
        raise InputError(f"the other object's slide has no {n} touches in a row; give a longer one with --length")
    first = int(np.nanargmin(means))
    return [frame.measurement for frame in foreign[first : first + n]]


def _best_cosine(measurement: Measurement, codes: np.ndarray) -> float:
    if not measurement.in_contact:
        return np.nan
    return float((codes @ (measurement.code / np.linalg.norm(measurement.code))).max())
