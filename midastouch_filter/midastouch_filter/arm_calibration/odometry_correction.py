"""What is wrong with the arm's odometry, taken out of it: errors of mount and clock, and motions of the object.

All hypotheses about the place share them. So they are learnt at one of them, the dominant mode, and every part of the
next step gets the better odometry. The gel is tracked there from map to map by contact odometry and by alignment, which
the arm only guides: so the track follows the object when that moves, and differs from what the arm says.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from midastouch_common import se3

from ..core.alignment import Aligned, PenetrationAlignment
from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.estimate import Calibration
from ..core.motion_model import Odometry
from ..core.noise_model import NoiseModel
from ..core.places import pose_distance
from ..core.stopwatch import Stopwatch
from ..core.touch import Measurement
from .arm_errors import ArmErrors, ObjectJump
from .contact_odometry import ContactOdometry

_CORRELATION = 7.5e-3  # m of path over which the errors of alignments are one and the same; 1 rad counts as 10 mm
_TOLD = 1.0  # nats by which the last maps must speak against an object at rest: `fits/object_motion.py`
_ASKED = 3  # last maps that are asked so
_PATIENCE = 3  # frames in a row that the track may fail to explain: over a sharp edge
_SAID = 0.1  # share of the prior's information below which a map says nothing


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
    def suspicion(self) -> float:
        """Log-odds [nats] of the likeliest jump of the object in the last frames against none."""
        return self._errors.suspicion

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
        better = self._errors.corrected(motion.transform, elapsed, self._felt_velocity(touch))
        self._arm = self._arm @ better
        jump = self._errors.jump
        if jump is None or self._track is None:
            return better
        still, moved = self._evidence(jump.at_rest), self._evidence(jump.pose)
        if moved - still < _TOLD:  # over ridges the track may have gone to the next one, which feels alike
            self._lose()
            return better
        self.jump = jump
        followed = self._mode @ jump.moved
        # the alignments of the last frames may have followed already
        if self._evidence(followed) > self._evidence(self._mode):
            self._track = followed
            return jump.moved @ better
        self._track = self._mode
        return better

    def _felt_velocity(self, touch: Measurement) -> np.ndarray | None:
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
        return sum(self._alignment.align(since @ track, self._near, felt).log_evidence for track, felt in self._felt)

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
        self._felt.append((self._track, penetration))
        away = pose_distance(self._track, belief.answers[0].pose) > self._config.mode_radius
        if away or self._unexplained > _PATIENCE:
            self._lose()
        elif explained:
            offset, information = without_prior(start, self._reach, found)
            self._errors.observe(start, offset, min(1.0, path / _CORRELATION) * information)

    def _lose(self) -> None:
        """The track ends: nothing is felt, or it left the place."""
        self._contact.restart()
        self._errors.forget_place()
        self._track: np.ndarray | None = None
        self._unexplained = 0
        self._felt: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=_ASKED)


def without_prior(pose: np.ndarray, covariance: np.ndarray, posterior: Aligned) -> tuple[np.ndarray, np.ndarray]:
    """What the map alone says, where the prior N(pose (4, 4), covariance (6, 6), own frame) became the posterior.

    Offset (6,) from that pose and its information (6, 6): none in directions of which the map says next to nothing.
    """
    scale = np.linalg.cholesky(covariance)
    gained, axes = np.linalg.eigh(scale.T @ np.linalg.inv(posterior.covariance) @ scale - np.eye(6))
    said = gained > _SAID
    gained, axes = gained[said], axes[:, said]
    towards = axes.T @ np.linalg.solve(scale, se3.log(se3.inverse(pose) @ posterior.pose))
    whitening = np.linalg.solve(scale.T, axes)
    return scale @ axes @ (towards * (gained + 1) / gained), (whitening * gained) @ whitening.T
