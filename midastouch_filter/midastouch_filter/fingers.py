"""Further fingers on the same object: the likelihoods of all that touch it multiply.

The state stays the pose of one gel, the reference. A particle and the transform between the gels give the pose of
every other finger, which is looked up, scored (equation 2) and kept at the surface like the reference's. Only its
surface constraint is softer: what a particle's rotation lacks, moves a gel that is a hand's width away by millimetres.

A finger that does not touch still tells something: it is not inside the object.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from midastouch_perception import se3

from . import motion_model
from .config import FilterConfig
from .gates import OccupiedGate, RestGate, UnchangedCodeGate
from .joint_alignment import FeltPenetration
from .lookup import PoseLookup
from .measurement_model import MeasurementModel
from .motion_model import Odometry
from .particles import Particles
from .surface import SurfaceConstraint
from .touch import FingerTouch
from .workers import Workers

_FARTHEST = 10.0  # m between two fingers of one hand
_UNKNOWN, _NONE = -2, -1  # instead of an entry: not searched for yet; none about


@dataclass(frozen=True)
class Evidence:
    """What one further finger adds in this step.

    name; T_gel_finger (4, 4); code (D,) at unit length, None if the finger touches nothing;
    penetration map (80, 60) m or None;
    share in [0, 1]: how much of it is independent of what the finger felt before.
    """

    name: str
    finger: Finger
    T_gel_finger: np.ndarray
    code: np.ndarray | None
    penetration: np.ndarray | None
    share: float

    def log_ratio(self, particles: Particles) -> np.ndarray:
        """(N,) float64: log-likelihood ratio of each particle."""
        return self.finger.log_ratio(particles, self.T_gel_finger, self.code)

    @property
    def felt_penetration(self) -> FeltPenetration:
        return FeltPenetration(self.penetration, self.T_gel_finger, self.name)

    def log_ratio_of_codebook(self) -> np.ndarray:
        """(M,) float32: that of every codebook entry as the finger's own pose."""
        self.finger.model.score_codebook(self.code)
        return self.finger.model.log_ratio

    def draw_matches(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """n entries (n,) int32 drawn by their likelihood of being the finger's pose."""
        self.finger.model.score_codebook(self.code)
        return self.finger.model.draw_matches(n, rng)


class Fingers:
    """All fingers but the reference, known by their names.

    Attributes: path [m], the longest that one of them moved in this frame, its turns included.
    Args: lookup, surface, config, workers as the filter's own; make_model: a measurement model for one more sensor.
    """

    def __init__(
        self,
        lookup: PoseLookup,
        surface: SurfaceConstraint,
        config: FilterConfig,
        workers: Workers,
        make_model: Callable[[], MeasurementModel],
    ):
        self._lookup, self._surface, self._config, self._workers = lookup, surface, config, workers
        self._make_model = make_model
        self._fingers: dict[str, Finger] = {}
        self.restart()

    def restart(self) -> None:
        """Forget what was felt: the particles were drawn anew."""
        self.path = 0.0
        self._travel = np.eye(4)
        for finger in self._fingers.values():
            finger.restart()

    def travelled(self, transform: np.ndarray) -> None:
        """The reference moved by `transform` (4, 4)."""
        self._travel = self._travel @ transform

    def force_update(self) -> None:
        """Count the next touch of each in full."""
        for finger in self._fingers.values():
            finger.force_update()

    def feel(self, touches: Mapping[str, FingerTouch], refuse: Callable[[str, str], None]) -> list[Evidence]:
        """Those that tell something new; `refuse(kind, reason)` is told of unusable ones.

        In the order of their names, so that the order they are given in does not matter. `count` what is used of it.
        """
        self.path = 0.0
        out = []
        for name in sorted(touches):
            try:
                T_gel_finger = _checked(touches[name].T_gel_finger)
            except ValueError as error:
                refuse("bad_finger_pose", f"finger {name}: {error}")
                continue
            finger = self._named(name)
            path = finger.moved_to(self._travel @ T_gel_finger)
            self.path = max(self.path, path)
            code, measurement = None, touches[name].measurement
            if measurement.in_contact:
                try:
                    code = finger.model.unit_code(measurement.code)
                except ValueError as error:
                    refuse("bad_code", f"finger {name}: {error}")
                    continue
            if finger.tells(path > 0, code):
                penetration = measurement.penetration if measurement.in_contact else None
                out.append(Evidence(name, finger, T_gel_finger, code, penetration, finger.share))
        return out

    @staticmethod
    def count(used: Sequence[Evidence]) -> float:
        """Their evidence was used: the paths to the next touches start here; the largest share of those that touch."""
        for each in used:
            each.finger.count()
        return max((each.share for each in used if each.code is not None), default=0.0)

    def _named(self, name: str) -> Finger:
        if name not in self._fingers:
            self._fingers[name] = Finger(self._lookup, self._surface, self._config, self._workers, self._make_model())
        return self._fingers[name]


def _checked(T_gel_finger: np.ndarray) -> np.ndarray:
    """The transform, its rotation orthonormal; raises ValueError saying why it cannot be used."""
    try:
        motion = Odometry.from_matrix(T_gel_finger)
    except ValueError as error:
        raise ValueError(str(error).replace("odometry", "pose")) from error
    if not motion.distance <= _FARTHEST:
        raise ValueError(f"pose is {motion.distance:.3g} m from the first finger's")
    return motion.transform


class Finger:
    """One further finger: what it felt last, and where in the codebook its poses were found.

    Attributes: model, which holds the scores of its last code.
    """

    def __init__(
        self,
        lookup: PoseLookup,
        surface: SurfaceConstraint,
        config: FilterConfig,
        workers: Workers,
        model: MeasurementModel,
    ):
        self._lookup, self._surface, self._config, self._workers = lookup, surface, config, workers
        self.model = model
        self._few = OccupiedGate()
        self.restart()

    def restart(self) -> None:
        self._rest, self._unchanged = RestGate(self._config), UnchangedCodeGate()
        self._pose: np.ndarray | None = None
        self._path = np.inf
        self._found = np.full(len(self._lookup), _UNKNOWN, np.int32)
        self._found_at = np.zeros(len(self._lookup))
        self._drift = 0.0
        self._T_gel_finger: np.ndarray | None = None

    def force_update(self) -> None:
        self._path = np.inf
        self._unchanged.reset()

    # ------------------------------------------------------------------ whether it tells something new

    def moved_to(self, pose: np.ndarray) -> float:
        """Its gel is at `pose` (4, 4), in the frame where the reference's started; the path [m] there, 0 at rest."""
        step = None if self._pose is None else Odometry.from_matrix(se3.inverse(self._pose) @ pose)
        self._pose = pose
        motion = self._rest.motion(step) if step else None
        path = motion.path if motion else 0.0
        self._path += path
        return path

    def tells(self, moved: bool, code: np.ndarray | None) -> bool:
        """Whether a code, None without contact, is more than what it felt before, said again."""
        if not (moved or np.isinf(self._path)):
            return False
        return code is None or not self._unchanged.skips(code)

    @property
    def share(self) -> float:
        """How much of a touch counts, as the path since the last one that did says."""
        return min(1.0, self._path / self._config.correlation_length)

    def count(self) -> None:
        """Its evidence was used: the path to the next starts here."""
        self._path = 0.0

    # ------------------------------------------------------------------ likelihood

    def log_ratio(self, particles: Particles, T_gel_finger: np.ndarray, code: np.ndarray | None) -> np.ndarray:
        """(N,) float64: log-likelihood ratio of the code and the surface constraint, of each particle."""
        c = self._config
        gels = motion_model.carried(particles, T_gel_finger, self._workers)
        distance = self._surface.distance(gels)
        lever = float(np.linalg.norm(T_gel_finger[:3, 3]))
        sigma = float(np.hypot(c.surface_sigma, c.noise_rotation * lever))
        codebook_distance = np.full(len(gels), self._surface.reach, np.float32)
        if code is None:
            return self._surface.bounded_log_weight(distance, codebook_distance, False, sigma)
        # where there is no surface, the code was felt by chance
        log_ratio = np.full(len(gels), np.log(self.model.outlier))
        near = np.flatnonzero(np.abs(distance) < c.dead_distance)
        start = self._starts(gels, near, T_gel_finger)
        near, start = near[start >= 0], start[start >= 0]
        if len(near):
            close = Particles(gels.positions[near], gels.quaternions[near], gels.log_weights[near], start)
            codebook_distance[near] = self._lookup.follow(close)
            self._remember(gels.entries[near], close.entries, codebook_distance[near] < self._surface.reach)
            if self._few.skips(len(near), len(self._lookup)):
                self.model.score_occupied(code, close)
            else:
                self.model.score_codebook(code)
            log_ratio[near] = self.model.log_likelihood(close)
            log_ratio[codebook_distance >= self._surface.reach] = np.log(self.model.outlier)
        return log_ratio + self._surface.bounded_log_weight(distance, codebook_distance, True, sigma)

    def _remember(self, entries: np.ndarray, found: np.ndarray, right: np.ndarray) -> None:
        self._found[entries[right]] = found[right]
        self._found_at[entries[right]] = self._drift

    def _starts(self, gels: Particles, near: np.ndarray, T_gel_finger: np.ndarray) -> np.ndarray:
        """An entry (n,) to walk on from for each of the gels `near` (n,); negative where there is none about.

        Particles that share the reference's entry have this finger nearly at the same place, also steps ago: the walk
        begins at the entry found for one of them, else for one of their neighbours. Only what is left is searched for.
        """
        self._drifted(T_gel_finger)
        entries = gels.entries[near]
        start = self._known(entries)
        off = np.flatnonzero(start < 0)
        around = self._known(self._lookup.neighbours[entries[off]])
        first = around[np.arange(len(off)), (around >= 0).argmax(axis=1)]
        start[off] = np.where(first >= 0, first, start[off])
        unknown = np.flatnonzero(start == _UNKNOWN)
        if len(unknown):
            rows = near[unknown]
            poses = se3.from_xyzquat(np.concatenate([gels.positions[rows], gels.quaternions[rows]], axis=1))
            found = self._lookup.exact(poses, within=self._surface.reach)
            found[found == len(self._lookup)] = _NONE
            self._remember(entries[unknown], found, found == _NONE)
            start[unknown] = found
        return start

    def _known(self, entries: np.ndarray) -> np.ndarray:
        """What was found last for these entries of the reference, unless that is too long ago to begin there."""
        fresh = self._drift - self._found_at[entries] < self._lookup.reach
        return np.where(fresh, self._found[entries], _UNKNOWN)

    def _drifted(self, T_gel_finger: np.ndarray) -> None:
        """The fingers moved against each other: what was found for others is worth less and less."""
        if self._T_gel_finger is not None:
            self._drift += Odometry.from_matrix(se3.inverse(self._T_gel_finger) @ T_gel_finger).path
        self._T_gel_finger = T_gel_finger
