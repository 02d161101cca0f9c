"""What is wrong with the arm's odometry: errors of mount and clock, and motions of the object it does not know of.

The arm says where the gel is but for two errors that stay: the mount's, a constant transform, and the clock's, a
constant time. Over a path that turns, both pull the pose away from where the penetration maps have it in ways that
nothing else does. A Kalman filter estimates them together with the error of the pose itself:

    state [error of the pose, error of the mount, error of the clock], measured: the first, by one alignment

When the object slips or is pushed, the error of the pose jumps: `jump_hypotheses.py` supposes so at every one of the
last frames.

A frame is taken into account a few frames later, when the velocity at it is known from both sides: a velocity from the
past alone lags behind, which would look like a clock.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3

from ..core.alignment import adjoint, transform_covariance
from ..core.estimate import Calibration
from .jump_hypotheses import POSE, JumpHypotheses

_MOUNT, _CLOCK = slice(6, 12), 12
_VELOCITY_FRAMES = 3  # frames on either side that a velocity is the mean of: between two poses it is mostly their noise
_RECENT_FRAMES = _VELOCITY_FRAMES + 1  # that the present velocity is the mean of: what there is of the same window
_SIGNIFICANT_SIGMAS = 3.0  # standard deviations by which an error must differ from none to be taken out


@dataclass(frozen=True)
class ObjectJump:
    """at_rest (4, 4): where the gel would have been in the last observed frame, had the object not moved; pose (4, 4):
    where it was instead, with covariance (6, 6) in its own frame, m^2 and rad^2."""

    at_rest: np.ndarray
    pose: np.ndarray
    covariance: np.ndarray

    @property
    def moved(self) -> np.ndarray:
        """(4, 4): the gel's motion over the object because the object moved."""
        return se3.inverse(self.at_rest) @ self.pose


@dataclass
class _Frame:
    """motion (4, 4) into it, which took `elapsed` [s], 0 if that is unknown; seen: as `observe` gets it."""

    motion: np.ndarray
    elapsed: float
    seen: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None


class ArmErrors:
    """Estimates mount and clock, takes their errors out of the arm's motion, and notices when the object jumps.

    Args: mount (6, 6), covariance of the mount's error before anything is measured, m^2, rad^2; clock [s], standard
    deviation of the clock's; zeros where they are believed. jitter (6, 6), covariance of one measured sensor pose; jump
    (6, 6), of the jumps of the object that are looked for, None for none; spread (6, 6), of the first pose observed.
    Attribute: jump of the object that became certain in this frame, else None.
    """

    def __init__(
        self, mount: np.ndarray, clock: float, jitter: np.ndarray, jump: np.ndarray | None, spread: np.ndarray
    ):
        self._jitter, self._jump, self._spread = jitter, jump, spread
        covariance = np.zeros((13, 13))
        covariance[_MOUNT, _MOUNT], covariance[_CLOCK, _CLOCK] = mount, clock**2
        self._prior = np.sqrt(np.diag(covariance)[6:])
        self._hypotheses = JumpHypotheses.only(covariance)
        # the hypotheses' errors are those of these, and of the pose
        self._mount, self._clock, self._touches = np.eye(4), 0.0, 0
        self.restart()

    def restart(self) -> None:
        """Forget the gel's pose and its motion; what was learnt of mount and clock stays."""
        self._frames: deque[_Frame] = deque(maxlen=2 * _VELOCITY_FRAMES + 1)
        self.forget_pose()
        self._velocity = self._present = np.zeros(6)

    def forget_pose(self) -> None:
        """Forget the gel's pose on the object; the arm's motion stays known."""
        for frame in self._frames:
            frame.seen = None
        self._pose: np.ndarray | None = None
        self.jump: ObjectJump | None = None
        self._hypotheses = self._hypotheses[[0]]
        self._hypotheses.mean[:, POSE] = 0.0

    @property
    def calibration(self) -> Calibration:
        """What is known at present."""
        covariance = self._hypotheses.covariance[0][6:, 6:].copy()
        return Calibration(self._mount, self._clock, covariance, self._prior, self._touches)

    @property
    def applied(self) -> tuple[np.ndarray, float]:
        """Mount (4, 4) and clock [s] as far as they are known to be wrong, axis by axis: a right one is left alone."""
        found = self.calibration
        errors = np.r_[se3.log(found.mount), found.clock]
        errors[~found.known | (np.abs(errors) < _SIGNIFICANT_SIGMAS * found.sigma)] = 0.0
        return se3.exp(errors[:6]), float(errors[6])

    def expected(self, elapsed: float) -> np.ndarray:
        """Motion (4, 4) of the gel in `elapsed` seconds if it goes on as the arm said last."""
        mount, _ = self.applied
        return mount @ se3.exp(elapsed * self._present) @ se3.inverse(mount)

    def corrected(self, motion: np.ndarray, elapsed: float | None, measured: np.ndarray | None = None) -> np.ndarray:
        """The arm's motion (4, 4) in `elapsed` seconds (None: unknown) without what is known of mount and clock.

        measured (6,): velocity of the gel over the object at present, if it is known better than from the arm: m/s,
        rad/s.
        """
        self.jump = None
        self._frames.append(_Frame(motion, elapsed or 0.0))
        if len(self._frames) == self._frames.maxlen:
            self._take(self._frames[_VELOCITY_FRAMES], _mean_velocity(list(self._frames)[1:]))
        mount, clock = self.applied
        before, self._present = self._present, _mean_velocity(list(self._frames)[-_RECENT_FRAMES:])
        if measured is not None:
            self._present = adjoint(mount) @ measured
        return _without(mount, clock, motion, before, self._present)

    def observe(self, pose: np.ndarray, offset: np.ndarray, information: np.ndarray) -> None:
        """The map alone has the gel at `offset` (6,) from pose (4, 4) in the newest frame, with information (6, 6), own
        frame, which may be none in some directions."""
        if self._frames:
            self._frames[-1].seen = pose, offset, information

    def _take(self, frame: _Frame, velocity: np.ndarray) -> None:
        """Account for a frame, at the velocity (6,) there."""
        before, self._velocity = self._velocity, velocity
        if self._pose is not None:
            self._propagate(_without(self._mount, self._clock, frame.motion, before, velocity), before)
        if frame.seen is None:
            return
        if self._pose is None:
            self._anchor(frame.seen[0])
            return
        if self._jump is not None:
            self._hypotheses = self._hypotheses.with_one_now(self._jump)
        pose, offset, information = frame.seen
        self._hypotheses.weigh(se3.log(se3.inverse(self._pose) @ pose) + offset, information, self._jitter)
        self._touches += 1
        best = self._hypotheses.decided()
        if best is not None:
            since = self._since()
            at_rest, moved = (self._pose @ se3.exp(mean[POSE]) @ since for mean in (best.before[0], best.mean[0]))
            self.jump = ObjectJump(at_rest, moved, transform_covariance(best.covariance[0][POSE, POSE], since))
            self._hypotheses = best
        self._settle()

    def _since(self) -> np.ndarray:
        """The gel's motion (4, 4) from the frame that is taken into account to the last observed one."""
        motion = np.eye(4)
        for frame in list(self._frames)[_VELOCITY_FRAMES + 1 : -1]:
            motion = motion @ _without(self._mount, self._clock, frame.motion, self._velocity, self._velocity)
        return motion

    def _propagate(self, motion: np.ndarray, velocity_before: np.ndarray) -> None:
        self._pose = self._pose @ motion
        carried, to_mount = adjoint(motion), adjoint(se3.inverse(self._mount))
        transition = np.eye(13)
        transition[POSE, POSE] = carried
        transition[POSE, _MOUNT] = carried @ to_mount - to_mount
        transition[POSE, _CLOCK] = to_mount @ self._velocity - carried @ to_mount @ velocity_before
        self._hypotheses.propagate(transition)

    def _settle(self) -> None:
        """Let the errors count from the first hypothesis' own pose, mount and clock."""
        change = self._hypotheses.settled()
        self._pose = self._pose @ se3.exp(change[POSE])
        self._mount = self._mount @ se3.exp(change[_MOUNT])
        self._clock += float(change[_CLOCK])

    def _anchor(self, pose: np.ndarray) -> None:
        """Begin at a pose (4, 4) that is known again, with what was learnt of mount and clock."""
        self._pose = pose
        covariance = self._hypotheses.covariance[0]
        covariance[POSE, :] = covariance[:, POSE] = 0.0
        covariance[POSE, POSE] = self._spread


def _without(
    mount: np.ndarray, clock: float, motion: np.ndarray, before: np.ndarray, velocity: np.ndarray
) -> np.ndarray:
    """The gel's motion (4, 4), of what the arm says, without the errors of mount (4, 4) and clock [s].

    before and velocity (6,): of the gel that the mount tells, where the motion starts and ends.
    """
    start, end = se3.exp(clock * before), se3.exp(clock * velocity)
    return mount @ se3.inverse(start) @ motion @ end @ se3.inverse(mount)


def _mean_velocity(frames: list[_Frame]) -> np.ndarray:
    """Mean velocity (6,) over some frames, m/s and rad/s; zero where no time is known."""
    timed = [frame for frame in frames if frame.elapsed]
    if not timed:
        return np.zeros(6)
    return sum(se3.log(frame.motion) for frame in timed) / sum(frame.elapsed for frame in timed)
