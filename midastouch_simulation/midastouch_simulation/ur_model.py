"""A UR5e of primitives for MuJoCo: joints, limits and lengths of the arm, a gel at its tool, an object that is held."""

from __future__ import annotations

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
