"""Fingers on one object: the likelihoods of all that touch it multiply.

The state is the pose of the first finger's gel. A particle and the transform between the gels give the pose of every
other finger, the identity that of the first. Each is looked up, scored (equation 2) and kept at the surface. Only the
surface constraint is softer for a finger away from the first: what a particle's rotation lacks, moves a gel that is a
hand's width away by millimetres.

A finger that does not touch still tells something: it is not inside the object.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError

from .config import FilterConfig
from .gates import Gates
from .lookup import GelSearch, PoseLookup
from .measurement_model import MeasurementModel
from .motion_model import Odometry, RestGate, transformed
from .particles import Particles
from .surface import SurfaceConstraint
from .touch import Measurement
from .workers import Workers

FIRST = ""
"""Name of the first finger, whose gel the particles are poses of."""

_LARGEST_HAND = 10.0  # m between two fingers of one hand


class Finger:
    """One finger: what it measures, how much of that is news, and how well it fits each particle.

    Attributes: name; touch, its measurement in this frame, map and transform checked; code (D,) at unit length, None if
    it touches nothing; tempering exponent in [0, 1]: how much of an independent touch this one counts.
    """

    def __init__(
        self,
        name: str,
        lookup: PoseLookup,
        surface: SurfaceConstraint,
        model: MeasurementModel,
        config: FilterConfig,
        workers: Workers,
        gates: Gates,
    ):
        self.name, self._model = name, model
        self._lookup, self._surface, self._config, self._workers = lookup, surface, config, workers
        self._gates, self._search = gates, GelSearch(lookup, surface.reach)
        self.restart()

    def restart(self) -> None:
        """Forget what was measured: the particles were drawn anew."""
        self._rest = RestGate(self._config, Gates())
        self._pose: np.ndarray | None = None
        self._search.restart()
        self.force_update()

    def force_update(self) -> None:
        """Count the next touch in full, even if nothing moves or the code is the last one again."""
        # since the last touch in contact, and the last one in the air, was counted
        self._path = {True: np.inf, False: np.inf}
        self._last_code: np.ndarray | None = None

    def use(self, model: MeasurementModel) -> None:
        """The look-up has other entries: score those."""
        self._model, self._search = model, GelSearch(self._lookup, self._surface.reach)

    # ------------------------------------------------------------------ whether it tells something new

    def moved_to(self, pose: np.ndarray) -> float:
        """Its gel is at `pose` (4, 4), in the frame where the first one's started; the path [m] there, 0 at rest."""
        step = None if self._pose is None else Odometry.from_matrix(se3.inverse(self._pose) @ pose)
        self._pose = pose
        motion = self._rest.motion(step) if step else None
        return self.moved(motion)

    def moved(self, motion: Odometry | None) -> float:
        """It moved, None at rest; the path [m]."""
        path = motion.path if motion else 0.0
        for contact in self._path:
            self._path[contact] += path
        return path

    def measures_anew(self, touch: Measurement, moved: bool) -> bool:
        """Take a touch; returns whether it is more than a repetition. Raises ValueError on a bad code."""
        code = self._model.unit_code(touch.code) if touch.in_contact else None
        path = self._path[touch.in_contact]
        if not (moved or np.isinf(path)):
            return False
        if code is not None and self._gates.skips("unchanged_code", np.array_equal(code, self._last_code)):
            return False
        if code is not None:
            self._last_code = code
        self.touch, self.code = touch, code
        # touches nearer together than that see nearly the same patch
        self.tempering = min(1.0, path / self._config.correlation_length)
        return True

    def count(self) -> None:
        """The touch was used: the path to the next starts here."""
        self._path[self.touch.in_contact] = 0.0

    # ------------------------------------------------------------------ likelihood

    def log_ratio(self, particles: Particles, codebook_distance: np.ndarray) -> np.ndarray:
        """(N,) float64: log-likelihood ratio of the code and the surface constraint, of each particle.

        codebook_distance (N,) [m]: of each particle to its codebook entry.
        """
        if self.touch.T_gel_finger is None and self.touch.in_contact:
            log_ratio = self._surface.log_weight(particles, codebook_distance)
            log_ratio += self._log_likelihood(particles)
            return log_ratio
        return self._log_ratio_there(particles, self.touch.T_gel_finger)

    def _log_ratio_there(self, particles: Particles, T_gel_finger: np.ndarray | None) -> np.ndarray:
        """Of a gel whose pose is known less well than the particle's; where no surface is, its code came by chance."""
        away = T_gel_finger is not None
        gels = transformed(particles, T_gel_finger, self._workers) if away else particles
        distance = self._surface.distance(gels)
        lever = float(np.linalg.norm(T_gel_finger[:3, 3])) if away else 0.0
        sigma = float(np.hypot(self._config.surface_sigma, self._config.noise_rotation * lever))
        codebook_distance = np.full(len(gels), self._surface.reach, np.float32)
        if not self.touch.in_contact:
            return self._surface.bounded_log_weight(distance, codebook_distance, False, sigma)
        chance = np.log(self._model.outlier)
        log_ratio = np.full(len(gels), chance)
        near = np.flatnonzero(np.abs(distance) < self._config.dead_distance)
        near, close, found = self._search.find(gels, near, T_gel_finger)
        if len(near):
            codebook_distance[near] = found
            log_ratio[near] = self._log_likelihood(close)
            log_ratio[codebook_distance >= self._surface.reach] = chance
        return log_ratio + self._surface.bounded_log_weight(distance, codebook_distance, True, sigma)

    def _log_likelihood(self, gels: Particles) -> np.ndarray:
        self._model.score_occupied(self.code, gels)
        return self._model.log_likelihood(gels)

    def log_ratio_of_codebook(self) -> np.ndarray:
        """(M,) float32: that of the code, of every codebook entry as the finger's own pose."""
        self._model.score_codebook(self.code)
        return self._model.log_ratio

    def draw_matches(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """n entries (n,) int32 drawn by their likelihood of being the finger's pose."""
        self._model.score_codebook(self.code)
        return self._model.draw_matches(n, rng)


class Fingers:
    """All fingers, known by their names.

    Attributes: path [m], the longest that a further one moved in this frame, its turns included.
    Args: make: a finger of that name; map_shape: of penetration maps that can be used, None if none are; gates.
    """

    def __init__(self, make: Callable[[str], Finger], map_shape: tuple[int, int] | None, gates: Gates):
        self._make, self._map_shape, self._gates = make, map_shape, gates
        self._fingers: dict[str, Finger] = {}
        self.restart()

    def restart(self) -> None:
        """Forget what was measured: the particles were drawn anew."""
        self.path = 0.0
        self._travel = np.eye(4)
        for finger in self._fingers.values():
            finger.restart()

    def force_update(self) -> None:
        """Count the next touch of each in full."""
        for finger in self._fingers.values():
            finger.force_update()

    def use(self, model_of: Callable[[str], MeasurementModel]) -> None:
        """The look-up has other entries: score those, each finger by the model of its name."""
        for name, finger in self._fingers.items():
            finger.use(model_of(name))

    def measure(
        self, touches: Mapping[str, Measurement], motion: Odometry | None, explained: Collection[str]
    ) -> list[Finger]:
        """Those that tell something new, by name, the first one first; unusable touches are refused.

        motion: of the first finger since the last frame, None at rest; explained: names of those whose last maps the
        belief explains. Another one with a map counts in full: its codes have to find a pose that the map fits.
        `count` what is used.
        """
        if motion is not None:
            self._travel = self._travel @ motion.transform
        self.path = 0.0
        measured = []
        for name in sorted(touches):
            try:
                if self._measures_anew(name, touches[name], motion):
                    finger = self._fingers[name]
                    if self._map_shape and finger.touch.penetration is not None and name not in explained:
                        finger.tempering = 1.0
                    measured.append(finger)
            except ValueError as error:
                kind, reason = error.args
                self._gates.refuse(kind, f"{_whose(name)}{reason}")
        return measured

    def _measures_anew(self, name: str, touch: Measurement, motion: Odometry | None) -> bool:
        """Raises ValueError(kind, reason) on a touch that cannot be used."""
        if name != FIRST:
            touch = replace(touch, T_gel_finger=_checked(touch.T_gel_finger))
        finger = self._fingers.get(name) or self._fingers.setdefault(name, self._make(name))
        if name == FIRST:
            path = finger.moved(motion)
        else:
            path = finger.moved_to(self._travel @ touch.T_gel_finger)
            self.path = max(self.path, path)
        try:
            anew = finger.measures_anew(touch, path > 0)
        except ValueError as error:
            raise ValueError("bad_code", str(error)) from error
        if anew and self._map_shape and touch.penetration is not None and not self._usable(name, touch):
            finger.touch = replace(touch, penetration=None)
        return anew

    def _usable(self, name: str, touch: Measurement) -> bool:
        """Whether there is a penetration map that can be compared with rendered ones."""
        penetration = touch.penetration
        if not touch.in_contact:
            return False
        if penetration.shape == self._map_shape and np.isfinite(penetration).all():
            return True
        reason = f"{_whose(name)}penetration map is not finite or not of shape {self._map_shape}"
        self._gates.refuse("bad_relief", reason)
        return False


def by_name(measurement: Measurement, others: Mapping[str, Measurement]) -> dict[str, Measurement]:
    """What all fingers measure, the first one under its name; raises InputError if a further one has none."""
    if FIRST in others:
        raise InputError("others: a further finger needs a name")
    return {FIRST: measurement, **others}


def count(measured: list[Finger]) -> float:
    """What these fingers measured was used; the largest tempering exponent of those that touch."""
    for finger in measured:
        finger.count()
    return max(finger.tempering for finger in measured if finger.touch.in_contact)


def _whose(name: str) -> str:
    return f"finger {name}: " if name else ""


def _checked(T_gel_finger: np.ndarray) -> np.ndarray:
    """The transform, its rotation orthonormal; raises ValueError(kind, reason) if it cannot be used."""
    try:
        motion = Odometry.from_matrix(T_gel_finger)
    except ValueError as error:
        raise ValueError("bad_finger_pose", str(error).replace("odometry", "pose")) from error
    if not motion.distance <= _LARGEST_HAND:
        raise ValueError("bad_finger_pose", f"pose is {motion.distance:.3g} m from the first finger's")
    return motion.transform
