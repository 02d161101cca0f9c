"""Start of the filter, and its steps from one frame of a node to the next."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel

from .active_touch.suggestion import Advice, Wanted
from .core.config import FilterConfig
from .core.estimate import Estimate
from .core.initialisation import checked_prior
from .core.pace import InTime, always
from .core.touch import Measurement
from .loaded_object import LoadedObject, RunningFilter

# Widest start: the paper's, appendix C (sigma_t = diagonal / 3, sigma_r = 60 degrees at beta = 1)
_WIDEST_ROTATION = math.radians(60.0)
# A given pose is at best as precise as one that an arm measures.
_SHARPEST_TRANSLATION = FilterConfig.jitter_translation
_SHARPEST_ROTATION = FilterConfig.jitter_rotation


@dataclasses.dataclass(frozen=True)
class Start:
    """A Gaussian start.

    Attributes
    ----------
    pose : `T_obj_gel` (4, 4)
    sigma_t, sigma_r : standard deviations per axis, [m] and [rad]

    Raises
    ------
    InputError
        The filter cannot start there. It is checked here, because a restart may use it long after it was given.
    """

    pose: np.ndarray
    sigma_t: float
    sigma_r: float

    def __post_init__(self) -> None:
        checked_prior(self.pose, self.sigma_t, self.sigma_r)


@dataclasses.dataclass(frozen=True)
class ObjectPrior:
    """Given pose of the object: T_base_obj (4, 4), sigma_t [m], sigma_r [rad]."""

    T_base_obj: np.ndarray
    sigma_t: float
    sigma_r: float

    def start(self, T_base_gel: np.ndarray) -> Start:
        """Return the start of a sensor at T_base_gel (4, 4); raises InputError as `Start` does."""
        T_obj_gel = se3.inverse(self.T_base_obj) @ T_base_gel
        lever = float(np.linalg.norm(T_obj_gel[:3, 3]))
        return Start(T_obj_gel, spread_at_lever(self.sigma_t, self.sigma_r, lever), self.sigma_r)


@dataclasses.dataclass(frozen=True)
class _Frame:
    """Frame that was processed. stamp [ns], None if unknown; T_gripper_gel (4, 4), None without a gripper; held:
    whether the gripper holds the object from it on."""

    T_base_gel: np.ndarray
    stamp: int | None
    T_gripper_gel: np.ndarray | None
    held: bool

    def motion_of(self, later: _Frame) -> np.ndarray:
        """Return the gel's motion (4, 4) relative to the object until a later frame: the object goes with the gripper
        that holds it, and rests in the base frame otherwise."""
        before, after = self.T_base_gel, later.T_base_gel
        if self.held and self.T_gripper_gel is not None and later.T_gripper_gel is not None:
            before, after = self.T_gripper_gel, later.T_gripper_gel
        return se3.inverse(before) @ after


def holds(held: bool, touches: Iterable[Measurement]) -> bool:
    """Return whether a gripper holds the object: from two fingers' touches on, until none is left."""
    count = sum(touch.in_contact for touch in touches)
    return count > (0 if held else 1)


class Localiser:
    """Filter on one object, with the sensor's pose at its last frame and the start that a restart uses.

    A restart, as after time ran backwards, begins at the pose that was given last: the sensor's on the object, or the
    object's in the base frame, which the sensor's pose at the next frame turns into a start.

    Parameters
    ----------
    first_start
        None to spread over the whole surface.
    wait
        With True, nothing starts before a pose is given.
    """

    def __init__(self, first_start: Start | None, wait: bool):
        self._start, self._wait = first_start, wait
        self._object: LoadedObject | None = None
        self._last: _Frame | None = None
        self._prior: ObjectPrior | None = None  # overrides `_start`
        self._pending_prior: ObjectPrior | None = None  # the same, until a frame brings the sensor's pose
        self._started = False
        self.estimate: Estimate | None = None

    @property
    def object(self) -> LoadedObject | None:
        """Object that the filter localises on; None before there is one."""
        return self._object

    @property
    def coarse(self) -> str:
        """Note of the object's coarse codebook (`LoadedObject.coarse`); empty without an object."""
        return self._object.coarse if self._object is not None else ""

    @property
    def sensor(self) -> SensorModel | None:
        """Sensor of the codes and maps, at map resolution; None if unknown."""
        return self._object.sensor if self._object is not None else None

    def advise(self, wanted: Wanted) -> Advice | None:
        """Suggest where to touch next; None before something was measured. Raises InputError if the filter cannot."""
        if self.filter is None:
            return None
        if self._object.advisor is None:
            raise InputError("the paper's filter cannot suggest where to touch next: set preset to balanced or fast")
        return self._object.advisor.advise(wanted)

    @property
    def filter(self) -> RunningFilter | None:
        """The running filter; None before it has an object and a start."""
        return self._object.filter if self._object is not None and self._started else None

    @property
    def unknown(self) -> float:
        """Probability that another object is touched: not the mesh, or none of the catalogue."""
        return 0.0 if self.filter is None else self.filter.identity[1]

    @property
    def waiting_for(self) -> str:
        """Reason why no filter is running; empty while one is."""
        if self._object is None:
            return "no object: set the parameters mesh and codebook or call set_object"
        return "" if self._started else "waiting for initialpose or object_pose_prior (init_mode is wait)"

    @property
    def untouched(self) -> bool:
        """True while no frame has reached the filter since its start."""
        return self._last is None

    @property
    def held(self) -> bool:
        """True while a gripper holds the object."""
        return self._last is not None and self._last.held

    def set_object(self, loaded: LoadedObject) -> None:
        """Localise on another object from scratch, because poses on the old one mean nothing there."""
        if self._object is not None:
            self._start = self._prior = None
        self.close()
        self._object = loaded
        if loaded.growth is not None:
            loaded.growth.start()
        self.restart()

    def close(self) -> None:
        """Stop building a denser codebook."""
        if self._object is not None:
            self._object.close()

    def restart(self) -> None:
        """Forget all measurements and start from the last pose that was given, or without one as at first."""
        self._pending_prior = self._prior
        self._begin(self._start)

    def _begin(self, start: Start | None) -> None:
        self.estimate = None
        self._last = None
        self._started = self._object is not None and not (self._wait and start is None)
        if not self._started:
            return
        if start is None:
            self._object.filter.initialise_uniform()
        else:
            self._object.filter.initialise_gaussian(start.pose, start.sigma_t, start.sigma_r)

    def start_anywhere(self) -> None:
        """Spread over the whole surface, now and at every later restart."""
        self._start, self._prior, self._wait = None, None, False
        self.restart()

    def start_at(self, start: Start) -> None:
        """Start at a pose of the sensor on the object."""
        self._start, self._prior = start, None
        self.restart()

    def expect_object_at(self, T_base_obj: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start at the next frame, from the object's pose.

        Parameters
        ----------
        T_base_obj : pose (4, 4) of the object in the robot's base frame
        sigma_t, sigma_r : its standard deviations per axis, [m] and [rad]
        """
        self._prior = self._pending_prior = ObjectPrior(T_base_obj, sigma_t, sigma_r)

    def T_base_obj(self) -> np.ndarray | None:
        """Return the object's pose in the base frame (4, 4), or None unless the state is `converged`."""
        if self._last is None or self.estimate is None or self.estimate.status.state != "converged":
            return None
        return self._last.T_base_gel @ se3.inverse(self.estimate.pose)

    def process(
        self,
        T_base_gel: np.ndarray,
        measurement: Measurement,
        others: Mapping[str, Measurement] | None = None,
        stamp: int | None = None,
        T_gripper_gel: np.ndarray | None = None,
    ) -> Estimate | None:
        """Process one frame.

        Parameters
        ----------
        T_base_gel : pose (4, 4) of the sensor in the base frame
        measurement
        others
            Measurements of further fingers, by name.
        stamp : time [ns] of the image, None if unknown
        T_gripper_gel
            Pose (4, 4) of the sensor in the frame of a gripper that may hold the object; None if the object rests.

        Returns
        -------
        Estimate or None
            None while no filter runs.

        Raises
        ------
        InputError
            The measurement cannot be used; the motion then counts at the next frame.
        """
        if self._pending_prior is not None and self._object is not None:
            # Cleared first, so that a prior which cannot be used is forgotten.
            prior, self._prior, self._pending_prior = self._pending_prior, None, None
            self._begin(prior.start(T_base_gel))
            self._prior = prior
        if self.filter is None:
            return None
        self._object.take_growth()
        others, last = others or {}, self._last
        held = T_gripper_gel is not None and holds(self.held, (measurement, *others.values()))
        frame = _Frame(T_base_gel, stamp, T_gripper_gel, held)
        moved = None if last is None else last.motion_of(frame)
        elapsed = None if last is None else seconds_between(last.stamp, stamp)
        self.estimate = self.filter.step(moved, measurement, others, elapsed)
        self._last = frame
        return self.estimate

    def deferred_update(self, in_time: InTime = always) -> None:
        """Run `ParticleFilter.deferred_update`; best called once the answer to a frame is out."""
        if self.filter is not None:
            self.filter.deferred_update(in_time)


def seconds_between(before: int | None, now: int | None) -> float | None:
    """Return the seconds between two stamps; None if one is unknown, or the first was far ahead by mistake.

    Parameters
    ----------
    before, now : [ns]

    Returns
    -------
    [s]
    """
    return 1e-9 * (now - before) if before is not None and now is not None and now > before else None


def spread_of(covariance: np.ndarray, diagonal: float) -> tuple[float, float]:
    """Convert a covariance to the spread of a start.

    A zero variance means "unknown", not "certain": RViz's 2D Pose Estimate leaves z, roll and pitch at zero. No sigma
    exceeds a third of the diagonal or 60 degrees (paper appendix C): RViz's 0.5 m is meaningless on a cup.

    Parameters
    ----------
    covariance : (6, 6) in REP-103 order
    diagonal : diagonal of the object [m]

    Returns
    -------
    sigma_t, sigma_r : float
        For `ParticleFilter.initialise_gaussian`, [m] and [rad], of the largest variance.
    """
    variances = np.diagonal(covariance)
    return (
        _spread(variances[:3], _SHARPEST_TRANSLATION, diagonal / 3),
        _spread(variances[3:], _SHARPEST_ROTATION, _WIDEST_ROTATION),
    )


def spread_at_lever(sigma_t: float, sigma_r: float, lever: float) -> float:
    """Return sigma_t [m] at a point `lever` metres from the pose's origin, which an error of rotation moves, too."""
    return math.hypot(sigma_t, sigma_r * lever)


def _spread(variances: np.ndarray, sharpest: float, widest: float) -> float:
    if (variances <= 0).any():
        return widest
    return float(np.clip(np.sqrt(variances.max()), min(sharpest, widest), widest))
