"""An arm in MuJoCo with sensor and controller; delays, friction, mount, and the hold of the object are random."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_motion.control.contact_servo import ContactServo, Limits
from midastouch_motion.control.controller import Controller
from midastouch_motion.control.guard import Guard
from midastouch_motion.control.measured import Measured
from midastouch_perception.contact import Contact
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.gel_layer import Gel
from midastouch_simulation.mujoco_arm import MujocoArm, Setting
from midastouch_simulation.rehearsal import Rehearsal

DEPTH = 5e-4
"""Depth [m] that the controller keeps."""
AT = np.array([0.45, 0.0, 0.3])
"""Point [m] in the base frame at which the object is touched."""

_MOUNT = 2e-3, np.radians(2.0)
_ARM_LATENCY = 0.05  # s, assumed by the controller
_LATENCIES = 0.02, 0.08  # s, the arm's own
_DELAYS, _JITTER = (0.02, 0.04), 0.01  # s of images: at 30 Hz the newest is no older than the guard allows
_FRICTIONS, _HOLDING = (0.2, 1.0), (5.0, 20.0)  # N
_RATES = 30.0, 60.0  # Hz
_BIAS, _NOISE, _WEIGHED = 5.0, 0.5, 0.1  # N, N, kg: errors of the arm's force, and of the tool's mass known to it
_GRAVITY = 9.81  # m/s^2


class ArmRig:
    """Arm, controller and their rehearsal. Args: mesh; sensor: full size; base_from_object: T_base_obj (4, 4); start:
    T_base_gel (4, 4); guard; see(T_obj_gel): returns the contact in an image there; rng.

    Attributes: arm; controller; rehearsal; frame_time [s]: between images.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        sensor: SensorModel,
        base_from_object: np.ndarray,
        start: np.ndarray,
        guard: Guard,
        see: Callable[[np.ndarray], Contact],
        rng: np.random.Generator,
    ):
        self._see, self._sensor = see, sensor.for_maps
        mount = turn(rng, _MOUNT[1])
        direction = rng.standard_normal(3)
        mount[:3, 3] = _MOUNT[0] * (direction / np.linalg.norm(direction))
        gel = Gel(friction=rng.uniform(*_FRICTIONS))
        holding = rng.choice([math.inf, rng.uniform(*_HOLDING)])
        latency = rng.uniform(*_LATENCIES)
        self.arm = MujocoArm(mesh, sensor, Setting(base_from_object, start, mount, gel, holding, latency))
        self.controller = Controller(ContactServo(Limits(depth=guard.depth), _ARM_LATENCY), guard)
        self._errors = rng.spawn(1)[0]  # the other draws stay the same
        self._bias, self._mass = self._errors.uniform(-_BIAS, _BIAS, 3), self._errors.uniform(-_WEIGHED, _WEIGHED)
        delay, fps = rng.uniform(*_DELAYS), rng.choice(_RATES)
        self.frame_time = 1 / fps
        self.rehearsal = Rehearsal(
            self.arm, lambda: self.arm.gel_on_object, self._look, self.controller, fps,
            lambda: delay + rng.uniform(0.0, _JITTER), self._measure_force,
        )  # fmt: skip

    def _measure_force(self) -> np.ndarray:
        """Return the force (3,) [N] on the gel that the arm's sensor measures."""
        weight = -_GRAVITY * self._mass * self.arm.pose[2, :3]
        return self.arm.wrench[:3] + weight + self._bias + _NOISE * self._errors.standard_normal(3)

    def _look(self, T_obj_gel: np.ndarray) -> Measured:
        contact = self._see(T_obj_gel)
        points = cloud_from_penetration(contact.penetration, contact.penetration > 0, self._sensor)
        return Measured.of(0.0, contact.depth_m, contact.area_m2, points, self._sensor)


def turn(rng: np.random.Generator, angle: float) -> np.ndarray:
    """Return a turn (4, 4) by `angle` rad about a random axis in the plane x y."""
    about = rng.uniform(0, 2 * np.pi)
    return se3.exp(np.array([0, 0, 0, angle * np.cos(about), angle * np.sin(about), 0]))
