"""What is wrong with the arm's odometry, taken out of it: errors of mount and clock, and motions of the object.

All pose hypotheses share them. So they are learnt at one of them, the dominant mode, and every part of the next step
gets the better odometry. The gel is tracked there from map to map, by alignment and by contact odometry: how the gel
moved over the object from one map to the next, without knowing where. Where the surface has shape, two maps in a row
say that; where it has none (along a plane, about the centre of a ball) a guess fills in, such as the arm's motion. The
arm only guides the track: so it follows the object when that moves, and differs from what the arm says.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_perception.sensor_model import SensorModel

from ..core.alignment import LEAST_GAIN, Aligned, PenetrationAlignment
from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.estimate import Calibration
from ..core.gates import Stopwatch
from ..core.motion_model import Odometry
from ..core.noise_model import NoiseModel
from ..core.pose_hypothesis import pose_distance
from ..core.touch import Measurement
from .arm_errors import ArmErrors, ObjectJump
from .jump_hypotheses import DECISIVE

_CORRELATION = 7.5e-3  # m of path over which the errors of alignments are one and the same; 1 rad counts as 10 mm
_JUMP_MAPS = 3  # last maps that must speak for a jump as clearly as the track does
_UNEXPLAINED_FRAMES = 3  # frames in a row that the track may fail to explain: over a sharp edge
_LEAST_INFORMATION = LEAST_GAIN / (1.0 - LEAST_GAIN)  # the same gain, as a fraction of the prior's information
_GOOD_FIT = 0.95  # fit from which the start from the guess is good enough


class AsMeasured:
    """The odometry is believed.

    Attributes: jump of the object that became certain in this frame, else None; calibration, what is known of mount and
    clock.
    """

    jump: ObjectJump | None = None
    calibration: Calibration | None = None

    def restart(self) -> None:
        """The particles were drawn anew."""

    def __call__(self, odometry: np.ndarray | None, touch: Measurement, elapsed: float | None) -> np.ndarray | None:
        """The better odometry (4, 4); touch of the first finger, `elapsed` [s] since the last frame."""
        return odometry

    def observe(self, belief: Belief, touch: Measurement, trusted: bool) -> None:
        """Learn from what the step made of the first finger's touch; trusted: whether its answer is relied on."""


class OdometryCorrection(AsMeasured):
    """Takes errors out of the odometry.

    Args: alignment; config; noise; watch.
    """

    def __init__(self, alignment: PenetrationAlignment, config: FilterConfig, noise: NoiseModel, watch: Stopwatch):
        self._alignment, self._config, self._watch = alignment, config, watch
        self._reach, self._near = config.object_jump + 2 * noise.jitter, noise.jitter + noise.mode_floor
        self._contact = ContactOdometry(alignment.sensor, noise, self._reach)
        unknown = float(config.calibration)
        self._errors = ArmErrors(
            unknown * config.mount_error,
            unknown * config.clock_offset,
            noise.jitter,
            config.object_jump if config.object_motion else None,
            noise.between_entries,
        )
        self.restart()

    def restart(self) -> None:
        self._errors.restart()
        self._lose()
        self._arm, self._seconds = np.eye(4), 0.0

    @property
    def calibration(self) -> Calibration | None:
        return self._errors.calibration if self._config.calibration else None

    def __call__(self, odometry: np.ndarray | None, touch: Measurement, elapsed: float | None) -> np.ndarray | None:
        self.jump = None
        try:
            motion = Odometry.from_matrix(np.eye(4) if odometry is None else odometry)
        except ValueError:
            return odometry
        if motion.distance > self._config.max_odometry_jump:
            return odometry
        with self._watch.stage("odometry"):
            return self._better(motion, touch, elapsed)

    def _better(self, motion: Odometry, touch: Measurement, elapsed: float | None) -> np.ndarray:
        self._seconds += math.nan if elapsed is None else elapsed
        better = self._errors.corrected(motion.transform, elapsed, self._measured_velocity(touch))
        self._arm = self._arm @ better
        jump = self._errors.jump
        if jump is None or self._track is None:
            return better
        followed = self._mode @ jump.moved
        if self._evidence(followed) - self._evidence(self._mode) < DECISIVE:
            # it is the track that went astray, as to the next of some ridges; or the alignments have followed already
            self._lose()
            return better
        self.jump, self._track = jump, followed
        return jump.moved @ better

    def _measured_velocity(self, touch: Measurement) -> np.ndarray | None:
        """Velocity (6,) over the object, m/s and rad/s, where the arm would tell it too late."""
        if not (self._seconds > 0 and self._errors.applied[1] and self._usable(touch)):
            return None
        if self._contact.is_last(touch.penetration):
            return None
        motion = self._contact.register(touch.penetration, self._errors.expected(self._seconds))
        return None if motion is None else se3.log(motion) / self._seconds

    def _usable(self, touch: Measurement) -> bool:
        penetration = touch.penetration
        if not touch.in_contact or penetration is None or penetration.shape != self._alignment.map_shape:
            return False
        return bool(np.isfinite(penetration).all())

    def _evidence(self, pose: np.ndarray) -> float:
        """How well the last maps fit the neighbourhood of a pose (4, 4) and of those before it along the track."""
        since = pose @ se3.inverse(self._track)
        return sum(
            self._alignment.align(since @ track, self._near, measured).log_evidence for track, measured in self._maps
        )

    def observe(self, belief: Belief, touch: Measurement, trusted: bool) -> None:
        if not self._usable(touch):
            self._lose()
            return
        self._mode = belief.modes[0].pose
        if not self._contact.is_last(touch.penetration):
            with self._watch.stage("track"):
                self._follow(belief, touch.penetration, trusted)

    def _follow(self, belief: Belief, penetration: np.ndarray, trusted: bool) -> None:
        """Go on with the track to this map, or begin one."""
        moved = self._contact.register(penetration, self._arm)
        self._contact.keep(penetration, moved)
        self._arm, self._seconds = np.eye(4), 0.0
        if self._track is None or moved is None:
            self._track = belief.answers[0].pose if trusted and 0 in belief.aligned else None
            return
        start = self._track @ moved
        found = self._alignment.align(start, self._reach, penetration)
        explained = found.fit > self._config.penetration_fit
        path = Odometry.from_matrix(se3.inverse(self._track) @ found.pose).path
        self._track = found.pose if explained else start
        self._unexplained = 0 if explained else self._unexplained + 1
        self._maps.append((self._track, penetration))
        away = pose_distance(self._track, belief.answers[0].pose) > self._config.mode_radius
        if away or self._unexplained > _UNEXPLAINED_FRAMES:
            self._lose()
        elif explained:
            offset, information = without_prior(start, self._reach, found)
            self._errors.observe(start, offset, min(1.0, path / _CORRELATION) * information)

    def _lose(self) -> None:
        """The track ends: nothing is touched, or it left the pose."""
        self._contact.restart()
        self._errors.forget_pose()
        self._track: np.ndarray | None = None
        self._unexplained = 0
        self._maps: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=_JUMP_MAPS)


def without_prior(pose: np.ndarray, covariance: np.ndarray, posterior: Aligned) -> tuple[np.ndarray, np.ndarray]:
    """What the map alone says, where the prior N(pose (4, 4), covariance (6, 6), own frame) became the posterior.

    Offset (6,) from that pose and its information (6, 6): none in directions of which the map says next to nothing.
    """
    scale = np.linalg.cholesky(covariance)
    gained, axes = np.linalg.eigh(scale.T @ np.linalg.inv(posterior.covariance) @ scale - np.eye(6))
    informed = gained > _LEAST_INFORMATION
    gained, axes = gained[informed], axes[:, informed]
    towards = axes.T @ np.linalg.solve(scale, se3.log(se3.inverse(pose) @ posterior.pose))
    whitening = np.linalg.solve(scale.T, axes)
    return scale @ axes @ (towards * (gained + 1) / gained), (whitening * gained) @ whitening.T


class ContactOdometry:
    """Keeps a map and registers the next one to it.

    Args: sensor, at the resolution of the maps; noise; reach (6, 6), covariance of how far contact and arm may
    disagree.
    """

    def __init__(self, sensor: SensorModel, noise: NoiseModel, reach: np.ndarray):
        self._reach = reach
        information = sensor.pixel_area / noise.map_correlation**2 / noise.map_noise**2
        gel_depth = np.ascontiguousarray(sensor.gel_depth)
        self._kernel = kernels.MapOdometry(gel_depth, sensor.focal, sensor.gel_distance, information)
        self.restart()

    def restart(self) -> None:
        """Forget the last map: nothing is touched, or the arm's motion since is unknown."""
        self._map: np.ndarray | None = None
        self._last: np.ndarray | None = None

    def keep(self, penetration: np.ndarray, motion: np.ndarray | None) -> None:
        """The next map is registered to this one, (H, W) float32 m; motion (4, 4) that led to it, None if unknown."""
        self._map, self._last = penetration, motion

    def is_last(self, penetration: np.ndarray) -> bool:
        """Whether this map (H, W) m is of the very same image again, and no new touch."""
        return self._map is not None and np.array_equal(self._map, penetration)

    def register(self, penetration: np.ndarray, guess: np.ndarray) -> np.ndarray | None:
        """Motion (4, 4) of the gel over the object from the map that is kept to this one; None if none is kept.

        guess (4, 4): the motion where the maps say nothing. It is looked for from there or, if that explains the maps
        badly, from the last one: when the object slips, that is nearer to the truth than what the arm says.
        """
        if self._map is None:
            return None
        motion, _, fit = self._kernel.align(self._map, penetration, guess, self._reach, guess)
        if fit < _GOOD_FIT and self._last is not None:
            other, _, other_fit = self._kernel.align(self._map, penetration, guess, self._reach, self._last)
            if 1 - other_fit < 0.5 * (1 - fit):
                return other
        return motion
