"""A gel on an arm that answers late, over objects whose images come late."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from simulated_arm import SimulatedArm

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_motion.control.contact_servo import ContactServo, Limits
from midastouch_motion.control.controller import Controller
from midastouch_motion.control.guard import Guard
from midastouch_motion.control.measured import Measured
from midastouch_motion.control.skills import Skill, SkillEnd
from midastouch_perception.contact import Contact
from midastouch_perception.objects import bundled_objects
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.rendering.contact_poses import Reachability
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.rehearsal import Rehearsal
from midastouch_simulation.slide import somewhere

SENSOR = SensorModel.load("digit_tacto").for_maps
_LEAST_AREA = 1.5e-6  # m^2


def controller_of(limits: Limits, arm_latency: float = 0.05) -> Controller:
    """One with room for all motions."""
    guard = Guard(np.full(3, -1.0), np.full(3, 1.0), limits.depth, stale=0.2)
    return Controller(ContactServo(limits, arm_latency), guard)


@dataclass
class World:
    """An object, and the delays [s] of images and arm, which moves for arm_timeout after a twist; noise of the depth
    [m]."""

    mesh: ObjectMesh
    image_delay: float = 0.05
    arm_latency: float = 0.05
    arm_timeout: float = 0.1
    fps: float = 30.0
    noise: float = 3e-5
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        self._renderer = PenetrationRenderer(self.mesh, SENSOR)
        self.rng = np.random.default_rng(0)

    def depth(self, pose: np.ndarray) -> float:
        """True depth [m] at a gel pose (4, 4) on the object."""
        return float(self._renderer.render(pose[None])[0].max())

    def look(self, pose: np.ndarray) -> Measured:
        """The contact that an image at a gel pose (4, 4) shows."""
        contact = Contact.of(np.maximum(self._renderer.render(pose[None])[0], 0), SENSOR)
        points = cloud_from_penetration(contact.penetration, contact.penetration > 0, SENSOR)
        depth = 0.0
        if contact.area_m2 >= _LEAST_AREA:
            depth = max(contact.depth_m + self.noise * self.rng.standard_normal(), 1e-6)
        return Measured.of(0.0, depth, contact.area_m2, points, SENSOR)

    def run(self, pose: np.ndarray, skills: list[Skill], seconds: float = 60.0) -> Run:
        """Carry out the skills one after the other, from a gel pose (4, 4)."""
        arm = SimulatedArm(pose, self.arm_latency, self.arm_timeout)
        controller = controller_of(self.limits, self.arm_latency)
        rehearsal = Rehearsal(arm, lambda: arm.pose, self.look, controller, self.fps, lambda: self.image_delay)
        out = Run()
        for skill in skills:
            ended = rehearsal.carry_out(
                skill, seconds - rehearsal.now, lambda moment: out.depths.append(self.depth(moment.where))
            )
            out.ended.append(ended)
        out.pose = arm.advance(rehearsal.now + 1.0)
        return out


@dataclass
class Run:
    """How each skill ended, None if it did not; depths [m], true ones, at each period; pose (4, 4) at the end."""

    ended: list[SkillEnd | None] = field(default_factory=list)
    depths: list[float] = field(default_factory=list)
    pose: np.ndarray = field(default_factory=lambda: np.eye(4))


@pytest.fixture(scope="session")
def world() -> Callable[..., World]:
    """Makes a world of a bundled object."""

    def make(name: str, **settings) -> World:
        return World(ObjectMesh.load(bundled_objects()[name]), **settings)

    return make


def above(mesh: ObjectMesh, rng: np.random.Generator, height: float, tilt: float = 0.0) -> np.ndarray:
    """A gel pose (4, 4) over a random place that can be touched, tilted by so many rad."""
    reachability = Reachability(mesh, SensorModel.load("digit_tacto"))
    point = somewhere(mesh, reachability, 0.5e-3, rng)
    frame = se3.frame_from_normal(mesh.smooth_normals(point[None]), rng.uniform(0, 6.28, 1))[0]
    axis = rng.standard_normal(2)
    turn = se3.exp(np.array([0, 0, 0, *(tilt * axis / np.linalg.norm(axis)), 0]))
    return se3.make(frame, point + height * frame[:, 2]) @ turn


@pytest.fixture
def ur_controller():
    """Starts a UR controller, with a fault if it is to have one."""
    pytest.importorskip("rtde_control", reason="needs ur-rtde: pip install ur-rtde")
    from .ur.controller_process import ControllerProcess

    running = []

    def start(fault: str = "") -> ControllerProcess:
        running.append(ControllerProcess(fault))
        return running[-1]

    yield start
    for process in running:
        process.end()
