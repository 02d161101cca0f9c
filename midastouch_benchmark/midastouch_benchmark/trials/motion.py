"""Closed loop: an arm in MuJoCo touches and slides by the readings of the depth network, and then faults happen."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import midastouch_motion
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.surface_walk import MIN_PROGRESS, Ahead, straight_on
from midastouch_motion.control.contact_servo import Limits
from midastouch_motion.control.guard import UNREAD, Guard
from midastouch_motion.control.skills import LiftSkill, Skill, SlideSkill, TouchSkill
from midastouch_perception.contact import Contact, ContactState
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.contact_poses import Reachability
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.rehearsal import PERIOD, PeriodState, Rehearsal
from midastouch_simulation.simulated_digit import SimulatedDigit
from midastouch_simulation.slide import somewhere
from midastouch_tools.jobs import Workers

from . import arm_rig
from .arm_rig import AT, DEPTH, ArmRig, turn
from .trial_log import Campaign, source_digest

_REACH, _CONE = np.radians((75.0, 90.0))  # tilt of the surfaces it is sent to, and the guard's limit
_HEIGHTS, _TILT = (3e-3, 15e-3), np.radians(5.0)  # where an approach begins
_LENGTHS, _ONWARD = (0.02, 0.06), 0.03  # m
_TIMEOUT = 20.0  # s of a motion
_STEP = 3e-3  # m, along the surface
_GOES_ON = np.radians(30.0)  # largest turn in a step of a surface that continues
_TRIES = 32
_BOX, _FORCE, _STALE = 1.5, 40.0, 0.1  # m around the base, N, s: what the guard stops at
_QUEUE, _JUMP, _LIFTED = 1.0, 5e-3, 5e-3  # s by which images come late; m; m

Fault = Callable[[Rehearsal, np.ndarray], float]


def _frozen(name: str) -> Fault:
    def inject(rehearsal: Rehearsal, _: np.ndarray) -> float:
        rehearsal.frozen.add(name)
        return _STALE

    return inject


def _set(name: str, value: object) -> Fault:
    def inject(rehearsal: Rehearsal, _: np.ndarray) -> float:
        rehearsal.frozen.add(name)
        setattr(rehearsal.seen, name, value)
        return 0.0

    return inject


def _jumps(rehearsal: Rehearsal, twist: np.ndarray) -> float:
    leads = rehearsal.seen.gel[:3, :3] @ twist[:3]
    rehearsal.jump = se3.translation(_JUMP * leads / np.linalg.norm(leads))
    return 0.0


def _outside(rehearsal: Rehearsal, twist: np.ndarray) -> float:
    """Let the box end behind the gel; a twist back into the box would be allowed."""
    leads, guard = rehearsal.seen.gel[:3, :3] @ twist[:3], rehearsal.controller.guard
    axis = np.abs(leads).argmax()
    low, high = guard.low.copy(), guard.high.copy()
    (high if leads[axis] > 0 else low)[axis] = rehearsal.seen.gel[axis, 3] - 1e-3 * np.sign(leads[axis])
    rehearsal.controller.guard = dataclasses.replace(guard, low=low, high=high)
    return 0.0


def _queues(rehearsal: Rehearsal, _: np.ndarray) -> float:
    rehearsal.delay = lambda: _QUEUE
    return _STALE


FAULTS: dict[str, Fault] = {
    "released": _frozen("enabled"),
    "no image": _frozen("image"),
    "no transform": _frozen("pose"),
    "no force": _frozen("wrench"),
    "lost": _set("lost", True),
    "force": _set("force", _FORCE + 1),
    "saturated": _set("unread", UNREAD[ContactState.SATURATED.value]),
    "images a second late": _queues,
    "outside": _outside,
    "TF jumps by 5 mm": _jumps,
    "nobody follows": _set("listeners", 0),
    "another commands": _set("commanders", 2),
}
"""Faults during a slide by name: each gets the slide's twist (6,), makes the fault happen, and returns the time [s]
after which the guard must notice it."""


@dataclasses.dataclass(frozen=True)
class MotionPlan(Campaign):
    """Settings of a run. trials: per object, with seeds from 0; sensor: by name; folder: of the log."""

    trials: int = 10
    sensor: str = "digit_tacto"
    folder: Path = Path("out/benchmark")
    LOG_NAME = "motion.jsonl"

    def describe(self) -> dict:
        """Return the settings for the JSON."""
        here = Path(midastouch_motion.__file__).parent
        return {
            "trials": self.trials,
            "sensor": self.sensor,
            "depth_mm": 1e3 * DEPTH,
            "tdn": load_tdn("fast", SensorModel.load(self.sensor)).network_id,
            "code": source_digest(here, Path(__file__), Path(arm_rig.__file__)),
        }

    def prepare(self, meshes: Sequence[ObjectMesh], workers: Workers) -> None:
        """Do nothing: there is no filter, so no codebook is needed."""

    def rounds(self) -> list[list[dict]]:
        """Return the labels by seed."""
        return [[{"seed": seed}] for seed in range(self.trials)]

    def depends_on(self, mesh: ObjectMesh) -> dict:
        """Return everything on which a trial depends, except its labels."""
        return self.describe() | {"trials": None}

    def trial(self, mesh: ObjectMesh, labels: dict) -> dict:
        """Touch, slide, and slide until a fault happens, each fault once."""
        return _Trial(mesh, self.sensor, labels["seed"]).run()


class _Trial:
    """One approach, one slide, and slides that faults interrupt."""

    def __init__(self, mesh: ObjectMesh, sensor_name: str, seed: int):
        self._mesh, self._seed = mesh, seed
        self._rng = rng = np.random.default_rng([seed, int(mesh.sha256[:8], 16)])
        sensor = SensorModel.load(sensor_name)
        self._background = no_contact_image(sensor, rng)
        self._digit = SimulatedDigit(mesh, sensor, self._background, seed)
        self._stage = DepthStage(load_tdn("fast", sensor))
        self._moments: list[tuple[float, bool]] = []
        rig = self._placed(sensor)
        self._arm, self._controller, self._rehearsal = rig.arm, rig.controller, rig.rehearsal

    def _placed(self, sensor: SensorModel) -> ArmRig:
        """Return an arm whose gel is over a random place that can be touched."""
        rng, mesh = self._rng, self._mesh
        guard = Guard(np.full(3, -_BOX), np.full(3, _BOX), Limits().depth, stale=_STALE, force=_FORCE, cone=_CONE)
        reachability, why = Reachability(mesh, sensor), ""
        for _ in range(_TRIES):
            point = somewhere(mesh, reachability, DEPTH, rng)
            frame = se3.frame_from_normal(mesh.smooth_normals(point[None]), rng.uniform(0, 2 * np.pi, 1))[0]
            up = turn(rng, rng.uniform(0, _REACH))
            base_from_object = se3.make(up[:3, :3], AT) @ se3.inverse(se3.make(frame, point))
            gel = se3.make(frame, point + rng.uniform(*_HEIGHTS) * frame[:, 2])
            start = base_from_object @ gel @ turn(rng, _TILT)
            try:
                return ArmRig(mesh, sensor, base_from_object, start, guard, self._see, rng)
            except InputError as error:  # the arm does not reach it
                why = str(error)
        raise InputError(f"{mesh.name}: none of {_TRIES} places is reached: {why}")

    def _see(self, T_obj_gel: np.ndarray) -> Contact:
        return self._stage.process(self._digit.look(T_obj_gel).image, self._background)

    def run(self) -> dict:
        """Run the trial and return touches, slide and faults: lists of one result for each, but one slide.

        Each motion: whether it ended, and succeeded; message; deepest_mm, along the gel's axis; indented_mm, of the
        shortest ways off the object the longest; path_mm. touches: depth_mm at the end. slide: images;
        held, how many of them within 0.25 mm of the depth; lost, whether the contact was lost although the surface
        continues; None if the touch failed. faults: name; periods until the twist was zero, None if it never was.
        The gel touches again after each fault; after a touch that fails, and where it cannot slide on, there is
        no further fault."""
        rng = self._rng
        trial: dict = {"touches": [self._touch()], "slide": None, "faults": []}
        if not trial["touches"][0]["success"]:
            return trial
        length = rng.uniform(*_LENGTHS)
        heading = self._heading(length)
        slide = self._motion(SlideSkill(heading, length, DEPTH))
        off = any(word in slide["message"] for word in ("was lost", "leaves the gel"))
        depths = np.array([depth for depth, image in self._moments if image])
        trial["slide"] = slide | {
            "images": len(depths),
            "held": int((np.abs(depths - DEPTH) <= 0.25e-3).sum()),
            "lost": off and self._goes_on(heading),
        }
        for name in rng.permutation(list(FAULTS)):
            if not self._controller.servo.touching:
                break
            if fault := self._fault(name):
                trial["faults"].append(fault)
                self._motion(LiftSkill(_LIFTED))
                trial["touches"].append(self._touch())
        return trial

    def _touch(self) -> dict:
        return self._motion(TouchSkill(DEPTH, 0.03)) | {"depth_mm": 1e3 * self._arm.deepest}

    def _motion(self, skill: Skill, after: Callable[[PeriodState], None] = lambda _: None) -> dict:
        self._moments.clear()

        indented = 0.0

        def keep(moment: PeriodState) -> None:
            nonlocal indented
            indented = self._arm.indented(indented)
            self._moments.append((self._arm.deepest, moment.image))
            after(moment)

        ended = self._rehearsal.carry_out(skill, _TIMEOUT, keep)
        return {
            "ended": ended is not None,
            "success": ended is not None and ended.success,
            "message": "did not end" if ended is None else ended.message,
            "deepest_mm": 1e3 * max(depth for depth, _ in self._moments),
            "indented_mm": 1e3 * indented,
            "path_mm": 1e3 * skill.path,
        }

    def _heading(self, length: float) -> float:
        """Return a direction in the gel's plane, if possible one in which the arm reaches the surface all the way."""
        for _ in range(_TRIES):
            heading = self._rng.uniform(-np.pi, np.pi)
            normals = [each.normal for each in self._ahead(heading, length)]
            if (np.array(normals) @ self._arm.base_from_object[2, :3] > np.cos(_REACH)).all():
                break
        return heading

    def _goes_on(self, heading: float) -> bool:
        """Return whether the surface below the gel continues, hardly turned, in a direction of the gel's plane."""
        begin, *ahead = self._ahead(heading, _STEP)
        return len(ahead) == 1 and bool(begin.normal @ ahead[0].normal > np.cos(_GOES_ON))

    def _ahead(self, heading: float, length: float) -> list[Ahead]:
        """Return steps over the surface from below the gel, in a direction of its plane, as far as the surface goes."""
        pose = self._arm.gel_on_object
        (point,), _, _ = self._mesh.closest_points(pose[None, :3, 3])
        (normal,) = self._mesh.smooth_normals(point[None])
        way = [Ahead(point, normal, pose[:3, :2] @ (np.cos(heading), np.sin(heading)), 0.0)]
        for _ in range(math.ceil(length / _STEP)):
            ahead = straight_on(self._mesh, way[-1].point, way[-1].heading, _STEP)
            if ahead.moved <= MIN_PROGRESS * _STEP:
                break
            way.append(ahead)
        return way

    def _fault(self, name: str) -> dict | None:
        """Slide on, and let a fault happen; None if the arm was at rest then."""
        begin = self._rehearsal.now + self._rng.uniform(0.2, 0.5)
        known, moving, stopped = math.inf, False, math.inf

        def after(moment: PeriodState) -> None:
            nonlocal known, moving, stopped
            if known == math.inf and moment.time >= begin:
                moving = bool(moment.twist.any())
                known = moment.time + (FAULTS[name](self._rehearsal, moment.twist) if moving else 0.0)
            elif known < math.inf and not moment.twist.any():
                stopped = min(stopped, moment.time)

        slide = self._motion(SlideSkill(self._heading(_ONWARD), _ONWARD, DEPTH), after)
        self._rehearsal.restore()
        if not moving:
            return None
        periods = None if stopped == math.inf else max(math.ceil((stopped - known) / PERIOD - 1e-6), 0)
        return slide | {"name": str(name), "periods": periods}
