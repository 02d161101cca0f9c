"""Velocity control of a gel on a surface: its depth, its tilt, and its motion along the surface.

An image is old when it arrives: the camera, the network, the messages and the arm each take time. So the depth and the
slope of the last image are predicted by the twists commanded since (Smith 1957), and the gains follow from the delay:
an integrating loop around a delay T does not overshoot up to a gain of 1 / (e T), even if the prediction is useless.
Any other change between images comes from the surface, which bends away or rises; that change is expected to continue.

Twists (6,) are of the gel, in its own frame: velocity [m/s] of its apex, and angular velocity [rad/s]. Its z axis
points out of the object.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError

from .commanded import Commanded
from .depth_watch import DepthWatch
from .measured import Measured

_DRIFT_OVER = 2.0  # delays over which drifts are averaged
_SLOWEST = 0.1  # fraction of the speed that is left while the gel hardly presses
_CENTRAL = 6e-3  # m from the apex: the image's border cuts a contact further out, whose depth is not trusted
_MISREAD = 1e-4  # m, median error of the depth that images show
_ON, _OFF = (2e-4, 1.0), (1e-3, 3.0)  # m into the surface or off it, and how many times the way along it, for that
_ASIDE = 1e-3  # m: a gel goes aside from a wall that leans over it further out than this
_APART, _PASSED = 2e-4, 25  # m, between the poses of a trail, and how many there are
_REMEMBERED = 30  # images whose delay counts
RIM = 1.2e-2
"""From a gel's apex to its corners [m]."""
LONGEST_PERIOD = 0.1
"""How long a twist is assumed to act [s]. An arm that receives no new twist for longer stops on its own."""


@dataclass(frozen=True)
class Limits:
    """Limits of motions: speed in contact and air_speed [m/s]; turn_speed [rad/s]; acceleration [m/s^2], not of turns,
    because late turns cost depth; depth [m] beyond which the gel is pulled back. Raises InputError for a limit that is
    not positive."""

    speed: float = 0.01
    air_speed: float = 0.02
    turn_speed: float = 0.5
    acceleration: float = 0.2
    depth: float = 1e-3

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"limit {name}: {value:g} is not a positive number")


class ContactServo:
    """Servo that keeps a gel at a depth and flat on a surface.

    Attributes: limits; touching, whether the last image shows a contact; fallen, whether it shows less depth than an
    earlier one although the gel has moved on into the surface since: then it is deeper than images show; risen, whether
    it shows more although the gel has moved off the surface: then a wall leans over the gel.

    Parameters
    ----------
    limits
        Speeds, acceleration and depth that it keeps to.
    arm_latency : from a command to the motion [s]
    """

    def __init__(self, limits: Limits, arm_latency: float):
        self.limits, self._commanded = limits, Commanded(arm_latency)
        self._delays: deque[float] = deque([0.1], maxlen=_REMEMBERED)
        self._unseen: deque[float] = deque([0.2], maxlen=_REMEMBERED)  # s from the image before to an image's arrival
        self._drift = np.zeros(3)  # of depth [m/s] and slope [1/s]: the surface's part in their change
        self._measured = Measured(-math.inf, 0.0, np.zeros(2), np.zeros(2))
        self._begun = -math.inf  # s; when the present motion began
        self._contact = math.inf, -math.inf  # stamps of its first and last image; gaps of up to `_settles` are none
        self._trail: deque[tuple[float, np.ndarray]] = deque(maxlen=_PASSED)  # s, and the poses then
        self._into, self._off = DepthWatch(self._commanded, 1.0, *_ON), DepthWatch(self._commanded, -1.0, *_OFF)
        self.fallen = self.risen = False

    @property
    def touching(self) -> bool:
        return self._measured.depth > 0

    @property
    def met(self) -> bool:
        """Whether the present motion has met what the last image shows."""
        return self.touching and self._contact[0] > self._begun

    @property
    def arm_latency(self) -> float:
        """From a command to the motion [s]."""
        return self._commanded.latency

    @property
    def stamp(self) -> float:
        """Stamp of the newest image [s]."""
        return self._measured.stamp

    @property
    def delay(self) -> float:
        """Longest recent time [s] from the stamp of an image to the arm's answer to it."""
        return max(self._delays) + self.arm_latency

    @property
    def gain(self) -> float:
        """Gain of depth and slope [1/s]."""
        return 1.0 / (math.e * self.delay)

    def measure(self, now: float, measured: Measured) -> None:
        """Take the measurement of an image.

        Parameters
        ----------
        now : time at which it became known [s]
        measured
        """
        before, self._measured = self._measured, measured
        if measured.depth > 0:
            first, last = self._contact
            self._contact = first if measured.stamp - last < self._settles else measured.stamp, measured.stamp
        self._delays.append(max(now - measured.stamp, 0.0))
        if before.stamp > -math.inf:
            self._unseen.append(max(now - before.stamp, 0.0))
        self.fallen, self.risen = self._into.contradicted(measured), self._off.contradicted(measured)
        passed = measured.stamp - before.stamp
        if not (before.depth > 0 and measured.depth > 0 and passed > 0):
            self._drift = np.zeros(3)
            return
        expected = _after(before, self._commanded.way(before.stamp, measured.stamp))
        weight = 1.0 - math.exp(-passed / (_DRIFT_OVER * self.delay))
        self._drift += weight * ((_values(measured) - expected) / passed - self._drift)

    @property
    def depth(self) -> float:
        """Depth [m] once the arm has carried out all commands; 0 if the last image shows no contact."""
        return max(float(self._predicted()[0]), 0.0) if self.touching else 0.0

    @property
    def displaced(self) -> float:
        """Largest volume [m^3] of the object in the gel that the last image allows, once the arm has carried out all
        commands; 0 if it shows no contact."""
        seen = self._measured
        return seen.area * (seen.mean + max(self.depth - seen.depth, 0.0) + _MISREAD)

    @property
    def slope(self) -> np.ndarray:
        """Slope (2,) of the surface once the arm has carried out all commands."""
        return self._predicted()[1:]

    @property
    def off_centre(self) -> np.ndarray:
        """Vector (2,) [m] by which the contact lies too far out; zero if all of it is seen."""
        centre = self._measured.centre
        return centre * max(1.0 - _CENTRAL / max(float(np.linalg.norm(centre)), 1e-12), 0.0)

    def back(self, depth: float) -> np.ndarray:
        """Return the velocity (2,) [m/s], within `slide_speed`, that brings all of the contact into view."""
        return _within(self.gain * self.off_centre, self.slide_speed(depth))

    @property
    def off(self) -> np.ndarray:
        """Direction (3,) that leads off the surface, and out from under a wall that leans over the gel."""
        if not self.risen:
            return np.array([0.0, 0.0, 1.0])
        way = np.array([*-self._measured.centre, _ASIDE])
        return way / np.linalg.norm(way)

    @property
    def trail(self) -> list[np.ndarray]:
        """Poses (4, 4) that the gel has passed on the last millimetres of the present motion, up to now."""
        return [pose for _, pose in self._trail]

    @property
    def stays(self) -> bool:
        """Whether the gel is on a surface that it has touched for some time, or all along its `trail`."""
        first, last = self._contact
        recently = self._commanded.now - self._settles
        return first < max(self._trail[0][0] if self._trail else self._commanded.now, recently) and last > recently

    @property
    def _settles(self) -> float:
        """Time [s] after which a contact is no longer one that has just been met, or is over."""
        return 2.0 * self.delay

    def approach_speed(self, depth: float) -> float:
        """Return the speed [m/s] at which the gel gets at most `depth` [m] deep before the arm answers to a contact."""
        return min(self.limits.speed, depth / self._blind)

    @property
    def flight_speed(self) -> float:
        """Speed [m/s] at which a wall that meets the gel's rim gets no deeper than the limit before the arm answers."""
        return min(self.limits.air_speed, self.limits.depth / self._blind)

    def turn_speed(self, depth: float) -> float:
        """Return the speed of turns [rad/s] at which the gel's other side, which comes down in a corner, stays above
        twice the `depth` [m] until the arm answers."""
        left = max(2.0 * depth - self.depth, 0.0)
        return min(self.limits.turn_speed, left / (RIM * self._blind))

    @property
    def _blind(self) -> float:
        """Longest recent time [s] from a contact, which may begin right after an image, to the arm's answer to it."""
        return max(self._unseen) + self.arm_latency

    def slide_speed(self, depth: float) -> float:
        """Return the speed [m/s] along the surface: the gel slides no further than `depth` [m] before the arm answers.

        It is slower if the gel is not at the depth, and zero at twice the depth, or if it is not yet flat.
        """
        held = min(max(2.0 - self.depth / depth, 0.0), max(self.depth / depth, _SLOWEST), 1.0)
        turning = self.gain * float(np.linalg.norm(self.slope)) / max(self.turn_speed(depth), 1e-12)
        return min(self.limits.speed, depth / self.delay) * held / max(turning, 1.0)

    def pressed(self, depth: float, along: np.ndarray) -> np.ndarray:
        """Return the twist that holds a depth and the gel flat, and slides it.

        Parameters
        ----------
        depth : [m]
        along : (2,) velocity in the gel's plane [m/s]

        Returns
        -------
        (6,) in the gel's frame [m/s, rad/s]
        """
        predicted, gain = self._predicted(), self.gain
        deeper, *slopes = self._drift + gain * (predicted - (depth, 0.0, 0.0))
        rising = _within(np.array(slopes), self.turn_speed(depth))
        # the surface rises ahead, and so does the gel
        return np.array([*along, predicted[1:] @ along + deeper, rising[1], -rising[0], 0.0])

    def _predicted(self) -> np.ndarray:
        """Return depth and slope (3,) once the arm has carried out all commands."""
        ahead = _after(
            self._measured, self._commanded.way(self._measured.stamp, self._commanded.now + self.arm_latency)
        )
        return ahead + max(self._commanded.now + self.arm_latency - self._measured.stamp, 0.0) * self._drift

    def command(self, now: float, twist: np.ndarray) -> np.ndarray:
        """Limit a twist, which acts from now on, and keep it for the prediction.

        Parameters
        ----------
        now : [s]
        twist : (6,) in the gel's frame [m/s, rad/s]

        Returns
        -------
        (6,), within the limits
        """
        speed = self.limits.speed if self.touching else self.limits.air_speed
        twist = np.concatenate([_within(twist[:3], speed), _within(twist[3:], self.limits.turn_speed)])
        change = self.limits.acceleration * max(min(now - self._commanded.now, LONGEST_PERIOD), 0.0)
        # a gel that has just touched may be faster than the limit: it slows down at once
        twist[:3] = _within(self._commanded.last[:3] + _within(twist[:3] - self._commanded.last[:3], change), speed)
        return self._commanded.keep(now, twist)

    def begin(self, now: float) -> np.ndarray:
        """Begin a motion at rest: return the zero twist, and keep it for the prediction."""
        self._begun = now
        self._trail.clear()
        return self.stop(now)

    def pass_by(self, now: float, pose: np.ndarray) -> None:
        """Take note of the gel's pose.

        Parameters
        ----------
        now : [s]
        pose : (4, 4), of the gel in the base frame
        """
        moved = se3.log(se3.inverse(self._trail[-1][1]) @ pose) if self._trail else np.full(6, _APART)
        if np.linalg.norm(moved[:3]) + RIM * np.linalg.norm(moved[3:]) >= _APART:
            self._trail.append((now, pose.copy()))

    def stop(self, now: float) -> np.ndarray:
        """Return the zero twist, which stops at once, and keep it for the prediction."""
        return self._commanded.keep(now, np.zeros(6))


def _values(measured: Measured) -> np.ndarray:
    """Return depth and slope (3,)."""
    return np.array([measured.depth, *measured.slope])


def _after(measured: Measured, way: np.ndarray) -> np.ndarray:
    """Return depth and slope (3,) once the gel has moved and turned by `way` (6,) on a plane."""
    change = measured.slope @ way[:2] - way[2], way[4], -way[3]
    return _values(measured) + change


def _within(vector: np.ndarray, most: float) -> np.ndarray:
    """Return the vector, shortened to `most` if it is longer."""
    return vector * min(1.0, most / max(float(np.linalg.norm(vector)), 1e-12))
