"""Velocity control of a gel on a surface: its depth, its tilt, and the way along.

What an image shows is old when it is there: the camera, the network, the messages and the arm each take their time. So
the depth and the slope of the last image are carried on by what was commanded since (Smith 1957), and the gains follow
from the delay: a loop around a delay T that integrates does not overshoot up to a gain of 1 / (e T), even where the
prediction is of no use. What images change beside that is the surface's doing, which bends away or rises; it is taken
to go on like that.

Twists (6,) are of the gel, in its own frame: velocity [m/s] of its apex, and angular velocity [rad/s]. Its z axis
points out of the object.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel

_STEP = 1e-5  # m, over which the gel's slope is taken
_TELLING = 2e-3  # m: a contact that extends less far tells little of the surface's slope
_STEEPEST = 0.5  # slope of a surface that is taken for one
_DRIFT_OVER = 2.0  # delays over which drifts are averaged
_SLOWEST = 0.1  # of the speed, where the gel is hardly pressed on
_CENTRAL = 6e-3  # m from the apex: a contact farther out is cut by the image's border, and its depth not trusted
_REMEMBERED = 30  # images whose delay counts
_COMMANDS = 1024  # kept; some seconds
LONGEST_PERIOD = 0.1
"""s after a twist that count: an arm that is told nothing for longer stops by itself."""


class Measured(NamedTuple):
    """What one image shows: stamp [s]; depth [m] of the gel's deepest point, 0 where nothing touches; slope (2,) of the
    touched surface, dz/dx and dz/dy in the gel's frame; centre (2,) m of the contact there."""

    stamp: float
    depth: float
    slope: np.ndarray
    centre: np.ndarray


@dataclass(frozen=True)
class Limits:
    """speed in contact and air_speed, m/s; turn_speed, rad/s; acceleration, m/s^2, which turns are free of, as late
    ones cost depth; depth, m, beyond which the gel is pulled back. Raises InputError for what is not positive."""

    speed: float = 0.01
    air_speed: float = 0.02
    turn_speed: float = 0.5
    acceleration: float = 0.2
    depth: float = 1e-3

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"limit {name}: {value:g} is not a positive number")


def centre_of(points: np.ndarray) -> np.ndarray:
    """Centre (2,) m of contact points (K, 3) m in the gel's frame; the apex without any."""
    return points[:, :2].mean(axis=0) if len(points) else np.zeros(2)


def slope_of(points: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Slope (2,) of the plane through contact points (K, 3) m in the gel's frame: dz/dx and dz/dy.

    By least squares, with a prior that weighs as much as a contact that extends 2 mm: the object lies on the gel, and
    so has the slope of the untouched gel there. By it the gel turns its apex to what is round, whose contact is small.
    """
    if len(points) < 3:
        return np.zeros(2)
    centre = centre_of(points)
    gel = np.array([sensor.sag(*(centre + each)) - sensor.sag(*(centre - each)) for each in _STEP * np.eye(2)])
    gel /= 2 * _STEP
    across = points[:, :2] - centre
    normal = across.T @ across + len(points) * _TELLING**2 * np.eye(2)
    beside = np.linalg.solve(normal, across.T @ (points[:, 2] - across @ gel))
    return np.clip(gel + beside, -_STEEPEST, _STEEPEST)


class ContactServo:
    """Keeps a gel at a depth and flat on a surface. Args: limits; arm_latency, s from a command to the motion.

    Attributes: limits; touching, whether the last image shows a contact.
    """

    def __init__(self, limits: Limits, arm_latency: float):
        self.limits, self._arm_latency = limits, arm_latency
        self._commands: deque[tuple[float, float, np.ndarray]] = deque(maxlen=_COMMANDS)  # from, to, twist
        self._delays: deque[float] = deque([0.1], maxlen=_REMEMBERED)
        self._last = np.zeros(6)
        self._drift = np.zeros(3)  # of depth and slope, 1 / s: what the surface does
        self._measured = Measured(-math.inf, 0.0, np.zeros(2), np.zeros(2))
        self._now = -math.inf

    @property
    def touching(self) -> bool:
        return self._measured.depth > 0

    @property
    def stamp(self) -> float:
        """Of the newest image, s."""
        return self._measured.stamp

    @property
    def delay(self) -> float:
        """Seconds from what an image shows to the arm's answer to it: the longest of late."""
        return max(self._delays) + self._arm_latency

    @property
    def gain(self) -> float:
        """1 / s, of depth and slope."""
        return 1.0 / (math.e * self.delay)

    def measure(self, now: float, measured: Measured) -> None:
        """An image was understood at `now` [s]."""
        before, self._measured = self._measured, measured
        self._delays.append(max(now - measured.stamp, 0.0))
        passed = measured.stamp - before.stamp
        if not (before.depth > 0 and measured.depth > 0 and passed > 0):
            self._drift = np.zeros(3)
            return
        expected = _after(before, self._commanded(before.stamp, measured.stamp))
        weight = 1.0 - math.exp(-passed / (_DRIFT_OVER * self.delay))
        self._drift += weight * ((_values(measured) - expected) / passed - self._drift)

    @property
    def depth(self) -> float:
        """Depth [m] when the arm has answered to all that was commanded; 0 where the last image shows no contact."""
        return max(float(self._predicted()[0]), 0.0) if self.touching else 0.0

    @property
    def slope(self) -> np.ndarray:
        """Slope (2,) of the surface then."""
        return self._predicted()[1:]

    @property
    def off_centre(self) -> np.ndarray:
        """By how much (2,) m the contact lies too far out; zero where all of it is seen."""
        centre = self._measured.centre
        return centre * max(1.0 - _CENTRAL / max(float(np.linalg.norm(centre)), 1e-12), 0.0)

    def back(self, depth: float) -> np.ndarray:
        """Velocity (2,) m/s that brings the contact to where all of it is seen, no faster than at `slide_speed`."""
        return _within(self.gain * self.off_centre, self.slide_speed(depth))

    def approach_speed(self, depth: float) -> float:
        """m/s at which the gel gets half as deep as `depth` [m] before the arm has answered to the first contact."""
        return min(self.limits.speed, 0.5 * depth / self.delay)

    def slide_speed(self, depth: float) -> float:
        """m/s at which the gel can go along the surface: no farther than it is deep [m] before the arm has answered.

        Slower where it is not at the depth, or not yet flat.
        """
        held = min(self._not_deeper(depth), max(self.depth / depth, _SLOWEST))
        turning = self.gain * float(np.linalg.norm(self.slope)) / self.limits.turn_speed
        return min(self.limits.speed, depth / self.delay) * held / max(turning, 1.0)

    def pressed(self, depth: float, along: np.ndarray) -> np.ndarray:
        """Twist that holds a depth [m] and the gel flat, and goes `along` (2,) [m/s] in the gel's plane."""
        predicted, gain = self._predicted(), self.gain
        deeper, *rising = self._drift + gain * (predicted - (depth, 0.0, 0.0))
        # in a corner the gel's other side comes down as it turns
        rising = self._not_deeper(depth) * np.array(rising)
        # the surface rises ahead, and so does the gel
        return np.array([*along, predicted[1:] @ along + deeper, rising[1], -rising[0], 0.0])

    def _not_deeper(self, depth: float) -> float:
        """Fraction of a motion that is left to a gel deeper than `depth` [m]; none at twice of it."""
        return min(max(2.0 - self.depth / depth, 0.0), 1.0)

    def _predicted(self) -> np.ndarray:
        """Depth and slope (3,) when the arm has answered to all that was commanded."""
        ahead = _after(self._measured, self._commanded(self._measured.stamp, self._now + self._arm_latency))
        return ahead + max(self._now + self._arm_latency - self._measured.stamp, 0.0) * self._drift

    def command(self, now: float, twist: np.ndarray) -> np.ndarray:
        """The twist within the limits, from now on; it is kept for the prediction."""
        speed = self.limits.speed if self.touching else self.limits.air_speed
        twist = np.concatenate([_within(twist[:3], speed), _within(twist[3:], self.limits.turn_speed)])
        change = self.limits.acceleration * max(min(now - self._now, LONGEST_PERIOD), 0.0)
        # what has just touched may be faster than the limit: it slows down at once
        twist[:3] = _within(self._last[:3] + _within(twist[:3] - self._last[:3], change), speed)
        return self._keep(now, twist)

    def stop(self, now: float) -> np.ndarray:
        """No motion from now on, at once."""
        return self._keep(now, np.zeros(6))

    def _keep(self, now: float, twist: np.ndarray) -> np.ndarray:
        if self._commands:
            begin, _, last = self._commands[-1]
            self._commands[-1] = begin, now, last
        self._commands.append((now, math.inf, twist))
        self._last, self._now = twist, now
        return twist

    def _commanded(self, since: float, until: float) -> np.ndarray:
        """Way and turn (6,) that the arm goes between two moments [s], by what was commanded so far."""
        since, until = since - self._arm_latency, min(until - self._arm_latency, self._now)
        total = np.zeros(6)
        for begin, end, twist in reversed(self._commands):
            if end <= since:
                break
            total += max(min(end, until) - max(begin, since), 0.0) * twist
        return total


def _values(measured: Measured) -> np.ndarray:
    """Depth and slope (3,)."""
    return np.array([measured.depth, *measured.slope])


def _after(measured: Measured, way: np.ndarray) -> np.ndarray:
    """Depth and slope (3,) once the gel has gone and turned by `way` (6,) on a plane."""
    change = measured.slope @ way[:2] - way[2], way[4], -way[3]
    return _values(measured) + change


def _within(vector: np.ndarray, most: float) -> np.ndarray:
    """The vector, no longer than that."""
    return vector * min(1.0, most / max(float(np.linalg.norm(vector)), 1e-12))
