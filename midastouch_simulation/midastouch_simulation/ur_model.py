"""A UR5e of primitives for MuJoCo, with a gel at its tool and an object that is held, and the arm's kinematics."""

from __future__ import annotations

from types import ModuleType
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_motion.ur.rtde import BASE_LINK_FROM_BASE

# Universal Robots, "DH parameters for calculations of kinematics and dynamics": a [m], d [m], alpha [rad], mass [kg]
_LINKS = (
    (0.0, 0.1625, np.pi / 2, 3.761),
    (-0.425, 0.0, 0.0, 8.058),
    (-0.3922, 0.0, 0.0, 2.846),
    (0.0, 0.1333, np.pi / 2, 1.37),
    (0.0, 0.0997, -np.pi / 2, 1.3),
    (0.0, 0.0996, 0.0, 0.365),
)
_TORQUES = (150.0, 150.0, 150.0, 28.0, 28.0, 28.0)  # N m, the same data sheet
JOINT_SPEED = np.pi
"""Largest speed of every joint [rad/s]."""
READY = np.radians([180.0, -70.0, 110.0, -130.0, -90.0, 0.0])
"""Joint positions (6,) [rad]: the elbow up, the tool down, in front of the base."""
FLANGE_FROM_GEL = se3.make(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.07]))
"""T_flange_gel (4, 4) by the drawing: the gel's z axis points at the flange."""
_STIFF, _SOFT = (2e4, 4e2), (2e3, 4e1)  # N m / rad and N m s / rad of the position loops: shoulder and elbow; wrist
_RADII = (0.06, 0.055, 0.045, 0.04, 0.04, 0.035)  # m
_STANDS_ON = 0.02  # m, lever of the friction against a turn
_LEVERS = np.array([1.0, 1.0, 1.0, 0.3, 0.3, 0.3])  # m, of a twist's turn: about an arm's, so that both parts count
_DAMPED = 3e-3  # m, damping of the least squares that turn a twist into joint speeds; matters if the arm is stretched
_FOLLOWED = 0.98  # fraction of every twist that the arm must follow: a depth cannot be held with less
_LED_ON = 0.99  # the same where a way ends: the arm must be led on from there
_SOON = 1e-2  # s
_CLOSE = 1e-4, 1e-3  # m, rad: a pose counts as reached
_MOST_ITERATIONS = 200
_LONGEST_STEP = 0.2  # rad


def ur_model(mount: np.ndarray, base_from_object: np.ndarray, holding: float, period: float) -> str:
    """Return the model as MJCF.

    It has bodies `gel` and `object`, and sites `drawn_gel`, where the gel is by the drawing, and `gel`, where it is:
    T_drawn_gel (4, 4) is `mount`. The object is at T_base_obj (4, 4) and gives way, level with the table, to more than
    `holding` N, or never if that is infinite. Links meet the table; the sensor's housing meets both. period [s]: step.
    """
    root = ElementTree.Element("mujoco", model="ur5e")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(root, "option", timestep=f"{period}", integrator="implicitfast")
    world = ElementTree.SubElement(root, "worldbody")
    ElementTree.SubElement(world, "geom", name="table", type="plane", size="1 1 0.1")
    _object(world, base_from_object, holding)
    bolted = ElementTree.SubElement(root, "contact")
    ElementTree.SubElement(bolted, "exclude", body1="world", body2="link0")
    actuators = ElementTree.SubElement(root, "actuator")
    fixed = BASE_LINK_FROM_BASE
    body = world
    for number, (a, d, alpha, mass) in enumerate(_LINKS):
        body = _body(body, f"link{number}", fixed, gravcomp="1")
        ElementTree.SubElement(body, "joint", name=f"joint{number}", axis="0 0 1", armature="0.1")
        fixed = se3.make(Rotation.from_euler("x", alpha).as_matrix(), np.array([a, 0.0, d]))
        _capsule(body, fixed[:3, 3], _RADII[number], mass)
        stiffness, damping = _STIFF if number < 3 else _SOFT
        most = f"{-_TORQUES[number]} {_TORQUES[number]}"
        ElementTree.SubElement(
            actuators, "position", joint=f"joint{number}", kp=f"{stiffness}", kv=f"{damping}", forcerange=most
        )
    drawn = fixed @ FLANGE_FROM_GEL
    _place(ElementTree.SubElement(body, "site", name="drawn_gel"), drawn)
    gel = _body(body, "gel", drawn @ mount, gravcomp="1")
    ElementTree.SubElement(gel, "site", name="gel")
    # the sensor's housing, behind the gel
    ElementTree.SubElement(gel, "geom", type="box", size="0.012 0.015 0.02", pos="0 0 0.03", mass="0.05")
    return ElementTree.tostring(root, encoding="unicode")


def _object(world: ElementTree.Element, base_from_object: np.ndarray, holding: float) -> None:
    body = _body(world, "object", base_from_object)
    ElementTree.SubElement(body, "site", name="object")
    ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="0.5", diaginertia="1e-3 1e-3 1e-3")
    if not np.isfinite(holding):
        return
    # nearly rigid: with MuJoCo's default it creeps at a tenth of the force
    holds = {"damping": "1", "solimpfriction": "0.9999 0.9999 0.001"}
    for name, kind, axis, arm in (
        ("x", "slide", "1 0 0", 1.0),
        ("y", "slide", "0 1 0", 1.0),
        ("turn", "hinge", "0 0 1", _STANDS_ON),
    ):
        axis = " ".join(f"{each}" for each in base_from_object[:3, :3].T @ np.array(axis.split(), float))
        joint = {"name": f"object_{name}", "type": kind, "axis": axis, "frictionloss": f"{arm * holding}"}
        ElementTree.SubElement(body, "joint", joint, **holds)


def _body(parent: ElementTree.Element, name: str, pose: np.ndarray, **attributes: str) -> ElementTree.Element:
    body = ElementTree.SubElement(parent, "body", {"name": name, **attributes})
    _place(body, pose)
    return body


def _place(element: ElementTree.Element, pose: np.ndarray) -> None:
    *position, x, y, z, w = se3.to_xyzquat(pose).tolist()
    element.set("pos", " ".join(map(str, position)))
    element.set("quat", f"{w} {x} {y} {z}")


def _capsule(body: ElementTree.Element, to: np.ndarray, radius: float, mass: float) -> None:
    shape = {"type": "capsule", "size": f"{radius}", "fromto": "0 0 0 " + " ".join(f"{each}" for each in to)}
    if np.linalg.norm(to) < 1e-6:
        shape = {"type": "sphere", "size": f"{radius}"}
    # links do not meet each other while the gel is in a box in front of the arm, but they may meet the table
    ElementTree.SubElement(body, "geom", {"mass": f"{mass}", "contype": "2", "conaffinity": "1", **shape})


def pose_of(site) -> np.ndarray:
    """Return the pose (4, 4) of one of MuJoCo's sites, in its world."""
    return se3.make(site.xmat.reshape(3, 3).copy(), site.xpos.copy())


class Kinematics:
    """Kinematics of an arm as `ur_model` makes it. Args: mujoco, the module; model and data, MuJoCo's own."""

    def __init__(self, mujoco: ModuleType, model, data):
        self._mujoco, self._model, self._data = mujoco, model, data
        arm = [model.joint(f"joint{number}").id for number in range(6)]
        self._places, self._speeds = model.jnt_qposadr[arm], model.jnt_dofadr[arm]
        self._gel = data.site("drawn_gel")

    @property
    def positions(self) -> np.ndarray:
        """Positions (6,) of the joints [rad]."""
        return self._data.qpos[self._places].copy()

    @positions.setter
    def positions(self, positions: np.ndarray) -> None:
        self._data.qpos[self._places] = positions
        self._mujoco.mj_fwdPosition(self._model, self._data)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities (6,) of the joints [rad/s]."""
        return self._data.qvel[self._speeds].copy()

    @property
    def pose(self) -> np.ndarray:
        """Pose T_base_gel (4, 4) by the drawing."""
        return pose_of(self._gel)

    @property
    def meets(self) -> bool:
        """True while a link touches the table, or the sensor's housing touches a link or the table."""
        return self._data.ncon > 0

    def follows(self, part: float = _FOLLOWED) -> bool:
        """Return whether the gel can follow this part of every twist: not if the arm is stretched, or two of its axes
        are in line."""
        return bool(self._weakest**2 >= part * (self._weakest**2 + _DAMPED**2))

    def leads_out(self, speeds: np.ndarray) -> bool:
        """Return whether joint speeds (6,) lead to where the gel follows twists better."""
        soon = Kinematics(self._mujoco, self._model, self._mujoco.MjData(self._model))
        soon.positions = self.positions + _SOON * speeds
        return soon._weakest > self._weakest

    @property
    def _weakest(self) -> float:
        return float(np.linalg.svd(self._jacobian, compute_uv=False)[-1])

    def speeds_of(self, twist: np.ndarray) -> np.ndarray:
        """Return joint speeds (6,) [rad/s] that give the drawn gel a twist (6,) in its frame: damped least squares."""
        jacobian = self._jacobian
        return jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + _DAMPED**2 * np.eye(6), _LEVERS * twist)

    @property
    def _jacobian(self) -> np.ndarray:
        """Jacobian (6, 6) [m]: twist of the gel, in its frame, times `_LEVERS`, per joint speed."""
        linear, angular = np.zeros((2, 3, self._model.nv))
        self._mujoco.mj_jacSite(self._model, self._data, linear, angular, self._gel.id)
        turned = self.pose[:3, :3].T
        twists = np.concatenate([turned @ linear[:, self._speeds], turned @ angular[:, self._speeds]])
        return _LEVERS[:, None] * twists

    def reach(self, goal: np.ndarray, passing: bool = False) -> bool:
        """Move the joints until the drawn gel is at a pose (4, 4); return whether it is, follows twists there, and
        meets nothing. If not, the joints stay where the way ended. passing: whether it may meet things on the way."""
        for _ in range(_MOST_ITERATIONS):
            error = se3.log(se3.inverse(self.pose) @ goal)
            there = bool(np.linalg.norm(error[:3]) < _CLOSE[0] and np.linalg.norm(error[3:]) < _CLOSE[1])
            if there or (self.meets and not passing):
                return there and not self.meets and self.follows(_LED_ON)
            step = self.speeds_of(error)
            self.positions += step * min(1.0, _LONGEST_STEP / float(np.abs(step).max()))
        return False
