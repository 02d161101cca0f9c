"""A simulated UR in MuJoCo: its gel follows twists late, presses on an object, and feels forces."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.missing_modules import install_extra
from midastouch_perception.sensor_model import SensorModel

from .gel_layer import Gel, GelLayer
from .rehearsal import Late
from .ur_model import JOINT_SPEED, READY, Kinematics, pose_of, ur_model

PERIOD = 2e-3
"""Time step of the physics [s]: that of a UR's own control loop."""
NOT_REACHED = "the arm is too short, cannot be led on from there, or would meet the table or its own sensor"
"""Reason why the arm does not reach a pose."""


def require_mujoco() -> ModuleType:
    """Return the module `mujoco`; raises InputError with the command that installs it if it is missing."""
    try:
        import mujoco
    except ImportError as error:
        raise InputError(f"an arm in MuJoCo needs MuJoCo; install it: {install_extra('mujoco')}") from error
    return mujoco


@dataclass(frozen=True)
class Setting:
    """Setting of a simulation: base_from_object, T_base_obj (4, 4); start, T_base_gel (4, 4) by the drawing; mount,
    T_drawn_gel (4, 4), its error; holding [N], force beyond which the object gives way; latency [s] from a command to
    the joints; timeout [s] after which the arm stops without a further command."""

    base_from_object: np.ndarray
    start: np.ndarray
    mount: np.ndarray = field(default_factory=lambda: np.eye(4))
    gel: Gel = field(default_factory=Gel)
    holding: float = math.inf
    latency: float = 0.05
    timeout: float = 0.1


class MujocoArm:
    """Simulated arm with a gel.

    An arm that meets the table, or its own sensor, stands still from then on, as in a UR's protective stop. At a
    singularity it follows only twists that lead away from it, as with MoveIt Servo.

    Attributes: time [s] since it was made; deepest [m], how far the object is in the gel; stopped, whether it has met
    something.

    Parameters
    ----------
    mesh
        The object.
    sensor
        Model of the sensor whose gel it has.
    setting

    Raises
    ------
    InputError
        The arm does not reach the start.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, setting: Setting):
        self._mujoco = mujoco = require_mujoco()
        text = ur_model(setting.mount, setting.base_from_object, setting.holding, PERIOD)
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        self._joints = Kinematics(mujoco, self._model, self._data)
        self._sites, self._bodies = {}, {}
        for name in ("gel", "object"):
            self._sites[name], self._bodies[name] = self._data.site(name), self._model.body(name).id
        self._layer = GelLayer(mesh, sensor, setting.gel)
        self._latency, self._timeout = setting.latency, setting.timeout
        self._twists: Late[np.ndarray] = Late()
        self._twist, self._until = np.zeros(6), -math.inf
        self._wrench, self.stopped = np.zeros(6), False
        self._joints.positions = READY
        if not self._joints.reach(setting.start, passing=True):
            where = ", ".join(f"{1e3 * each:.0f}" for each in setting.start[:3, 3])
            raise InputError(f"the arm does not reach ({where}) mm with the gel turned as wanted")
        self._data.ctrl[:] = self._joints.positions
        mujoco.mj_forward(self._model, self._data)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._data.time

    @property
    def deepest(self) -> float:
        """Depth of the object in the gel [m]."""
        return self._layer.deepest

    def indented(self, least: float) -> float:
        """Shortest way [m], of at least `least`, on which the gel gets off the object."""
        return self._layer.indented(self.gel_on_object, least)

    @property
    def pose(self) -> np.ndarray:
        """Pose T_base_gel (4, 4) by the joints and the drawing, which TF has."""
        return self._joints.pose

    @property
    def gel_on_object(self) -> np.ndarray:
        """True pose T_obj_gel (4, 4) of the gel on the object."""
        return se3.inverse(self.base_from_object) @ pose_of(self._sites["gel"])

    @property
    def base_from_object(self) -> np.ndarray:
        """Pose T_base_obj (4, 4) of the object."""
        return pose_of(self._sites["object"])

    @property
    def joints(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] of the joints."""
        return self._joints.positions, self._joints.velocities

    @property
    def wrench(self) -> np.ndarray:
        """Force [N] and torque [N m] about the apex (6,) on the gel, in its frame."""
        return self._wrench

    def command(self, now: float, twist: np.ndarray) -> None:
        """Take a twist.

        Parameters
        ----------
        now : time of its arrival [s]
        twist : (6,) in the gel's frame, as drawn
        """
        self._twists.send(now + self._latency, twist.copy())

    def advance(self, now: float) -> np.ndarray:
        """Simulate until `now` [s] and return the pose (4, 4), as drawn."""
        while self.time < now - PERIOD / 2:
            self._follow()
            self._press()
            if self.stopped:  # its brakes are on
                self._data.time += PERIOD
            else:
                self._mujoco.mj_step(self._model, self._data)
                if self._joints.meets:
                    self.stopped, self._data.qvel[:] = True, 0.0
        return self.pose

    def reaches(self, poses: np.ndarray) -> np.ndarray:
        """Return whether (N,) the arm gets to poses T_base_gel (N, 4, 4), as drawn, one after the other from where it
        is, follows twists there, and meets neither the table nor its sensor. It continues from the last pose that it
        reached; a stopped arm reaches none."""
        reached = np.zeros(len(poses), bool)
        if self.stopped:
            return reached
        joints = Kinematics(self._mujoco, self._model, self._mujoco.MjData(self._model))
        joints.positions = here = self._joints.positions
        for number, pose in enumerate(poses):
            reached[number] = joints.reach(pose)
            here = joints.positions if reached[number] else here
            joints.positions = here
        return reached

    def _follow(self) -> None:
        for begins, twist in self._twists.arrived(self.time):
            self._twist, self._until = twist, begins + self._timeout
        if self.time < self._until:
            speeds = self._joints.speeds_of(self._twist)
            if self._joints.follows() or self._joints.leads_out(speeds):
                self._data.ctrl += PERIOD * speeds * min(1.0, JOINT_SPEED / max(float(np.abs(speeds).max()), 1e-9))

    def _press(self) -> None:
        """Apply the gel's forces to the arm and to the object."""
        gel = pose_of(self._sites["gel"])
        velocity = self._velocity("gel", gel[:3, 3]) - self._velocity("object", gel[:3, 3])
        self._wrench = self._layer.force(self.gel_on_object, (gel[:3, :3].T @ velocity)[:2], PERIOD)
        self._data.qfrc_applied[:] = 0.0
        if self._wrench.any():
            force, torque = (gel[:3, :3] @ part for part in self._wrench.reshape(2, 3))
            self._apply("gel", force, torque, gel[:3, 3])
            self._apply("object", -force, -torque, gel[:3, 3])

    def _apply(self, body: str, force: np.ndarray, torque: np.ndarray, at: np.ndarray) -> None:
        where = at, self._bodies[body]
        self._mujoco.mj_applyFT(self._model, self._data, force, torque, *where, self._data.qfrc_applied)

    def _velocity(self, body: str, at: np.ndarray) -> np.ndarray:
        """Return the velocity (3,) [m/s] of a point (3,) [m] that moves with a body; base frame."""
        linear = np.zeros((3, self._model.nv))
        self._mujoco.mj_jac(self._model, self._data, linear, None, at, self._bodies[body])
        return linear @ self._data.qvel


def over(mesh: ObjectMesh, base_from_object: np.ndarray, height: float) -> np.ndarray:
    """Return the pose of a gel over the highest point of an object, facing down.

    Parameters
    ----------
    mesh
    base_from_object : `T_base_obj` (4, 4)
    height : above that point [m]

    Returns
    -------
    `T_base_gel` (4, 4)
    """
    points = base_from_object[:3, :3] @ mesh.vertices.T + base_from_object[:3, 3:]
    return se3.translation(points[:, points[2].argmax()] + (0.0, 0.0, height))
