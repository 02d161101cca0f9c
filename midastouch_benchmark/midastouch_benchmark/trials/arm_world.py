"""A `World` with an arm in MuJoCo, which carries out acts by the skills of the node `contact_controller`."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import NamedTuple, TypeVar

import numpy as np

from midastouch_bringup.parameter_files import read_parameters
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_motion.control import skills
from midastouch_motion.control.guard import Guard
from midastouch_motion.exploration.acts import Act, Approach, CheckReach, Done, Lift, Plan, Slide, Touch, carried_out
from midastouch_motion.exploration.reach import Reach
from midastouch_perception.contact import Contact
from midastouch_perception.pipeline import TouchReading
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.mujoco_arm import NOT_REACHED, over
from midastouch_simulation.rehearsal import PeriodState
from midastouch_tools.ros.launch_file import SHARE

from .arm_rig import AT, DEPTH, ArmRig

_ABOVE = 0.01  # m, height of the gel over the object's highest point at the start
_TIMEOUT = 120.0  # s of an act

_T = TypeVar("_T")


class Sensed(NamedTuple):
    """Touch measured in an image, and T_base_gel (4, 4) according to the arm's own joints."""

    touch: TouchReading
    measured: np.ndarray


class ArmWorld:
    """World of an arm; limits of motions and reach are those of `midastouch run explore arm:=mujoco`.

    Attributes: rig; reach: of the arm; sensed: of the image last yielded; deepest [m]: largest depth of the object in
    the gel so far, along its axis; indented [m]: largest of the shortest ways off the object. Args: mesh: lies on a
    random side; sensor: full size; perceive(T_obj_gel): measures an image there; rng.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        sensor: SensorModel,
        perceive: Callable[[np.ndarray], TouchReading],
        rng: np.random.Generator,
    ):
        settings = read_parameters(SHARE / "config" / "explore_mujoco.yaml")
        of_controller, of_explorer = settings["contact_controller"], settings["explorer"]
        box = np.array(of_controller["box_low"]), np.array(of_controller["box_high"])
        guard = Guard(
            *box, of_controller["max_depth"], force=of_controller["max_force"], cone=of_controller["max_tilt"]
        )
        self.reach = Reach(of_explorer["reach_low"], of_explorer["reach_high"], of_explorer["max_tilt"], asks=True)
        self._perceive = perceive
        self._coming: list[tuple[np.ndarray, Sensed]] = []
        self.deepest = self.indented = 0.0
        self.rig: ArmRig | None = None  # takes its first image while it is made
        base_from_object = se3.make(se3.random_rotations(1, rng)[0], AT)
        start = over(mesh, base_from_object, _ABOVE)
        self.rig = ArmRig(mesh, sensor, base_from_object, start, guard, self._see, rng)

    @property
    def base_from_gel(self) -> np.ndarray:
        """T_base_gel (4, 4) according to the arm."""
        return self.rig.arm.pose

    def follow(self, plan: Plan[_T]) -> Generator[np.ndarray, None, _T]:
        """Carry out a plan; yield T_obj_gel (4, 4), one per image, and return the plan's result."""
        return (yield from carried_out(plan, self.carry_out))

    def carry_out(self, act: Act | CheckReach) -> Generator[np.ndarray, None, Done]:
        """Move the arm; when it is done, yield T_obj_gel (4, 4), one per image, and return how it ended. A `CheckReach`
        is answered as `mujoco_arm` does."""
        if isinstance(act, CheckReach):
            reached = bool(self.rig.arm.reaches(act.poses).all())
            return self._done(skills.SkillEnd(reached, "" if reached else NOT_REACHED), 0.0)
        skill = _skill(act)
        ended = self.rig.rehearsal.carry_out(skill, _TIMEOUT, self._watch)
        if ended is None:
            self.rig.controller.cancel(self.rig.rehearsal.now)
            ended = skills.SkillEnd(False, f"not done after {_TIMEOUT:.0f} s")
        coming, self._coming = self._coming, []
        for pose, self.sensed in coming:
            yield pose
        return self._done(ended, skill.path)

    def _done(self, ended: skills.SkillEnd, path: float) -> Done:
        return Done(*ended, path, self.rig.controller.servo.touching, self.base_from_gel)

    def _watch(self, _: PeriodState) -> None:
        self.deepest = max(self.deepest, self.rig.arm.deepest)
        self.indented = self.rig.arm.indented(self.indented)

    def _see(self, T_obj_gel: np.ndarray) -> Contact:
        touch = self._perceive(T_obj_gel)
        if self.rig is not None:
            self._coming.append((T_obj_gel, Sensed(touch, self.rig.arm.pose)))
        return touch.contact


def _skill(act: Act) -> skills.Skill:
    match act:
        case Touch(distance, direction):
            return skills.TouchSkill(DEPTH, distance, np.array(direction))
        case Slide(heading, length):
            return skills.SlideSkill(heading, length, DEPTH)
        case Lift(height):
            return skills.LiftSkill(height)
        case Approach(pose):
            return skills.ApproachSkill(pose)
