"""Node `simulated_gripper`: a gripper with a sensor on each finger pinches a simulated object, and carries it."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from itertools import chain

import numpy as np
from rclpy.clock import Clock, ClockType

from midastouch_common import se3
from midastouch_common.frames import GEL_FRAME
from midastouch_common.message_arrays import pose_from_msg, transform_from_msg
from midastouch_common.pose_metric import pose_errors
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.addresses import load_mesh
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_msgs.msg import FilterStatus, PoseModes, TactileContact
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.group import Symmetry

from ..gripper import Gripped, SimulatedGripper
from . import pace

SIDES = "left", "right"
"""Namespaces of the two sensors; the filter runs in the first."""
PARAMETERS = (
    *pace.PARAMETERS,
    Parameter(
        "pinches", 6, "It ends once the filter is sure in one, at the latest in the last", minimum=1, maximum=1000
    ),
    Parameter("gripper_frame_id", "gripper", "Frame of the gripper, between its fingers"),
)

_NEAR_MM = 5.0  # of the truth: right


class SimulatedGripperNode(PipelineNode):
    """Node that moves gripper and object on TF at the pace of the filter, and compares `object_pose_modes` with the
    truth after each pinch. After the last one `on_end` is called; `gave_up`: the filter is not sure, or not right."""

    def __init__(self, on_end: Callable[[], object] = lambda: None, **node_options) -> None:
        super().__init__("simulated_gripper", **node_options)
        settings = self._settings = Parameters(self, PARAMETERS)
        sensor, rng = SensorModel.load(settings["sensor_model"]), np.random.default_rng(settings["seed"])
        self._gripper = SimulatedGripper(load_mesh(settings["mesh"]), sensor, rng)
        self._frames = [settings[f"{name}_frame_id"] for name in ("base", "gripper", "object")]
        self._pace, self._untouched = pace.Pace(self, settings["fps"]), Counter[str]()
        self._state, self._modes, self._on_end, self.gave_up = "", PoseModes(), on_end, False
        self._pinched, self._over, self._way = 0, False, self._gripper.pinch()
        diagnostics.Diagnostics(self, self._describe)
        for side in SIDES:
            self.create_subscription(
                TactileContact, f"{side}/tactile/contact", partial(self._on_contact, side), qos.stream_subscriber(10)
            )
        self.create_subscription(PoseModes, f"{SIDES[0]}/object_pose_modes", self._on_modes, qos.stream_subscriber(10))
        self.create_subscription(FilterStatus, f"{SIDES[0]}/filter_status", self._on_filter, qos.latched(depth=100))
        self.create_timer(1 / settings["fps"], self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def _ready(self) -> bool:
        """True after enough untouched images: `tdn` would learn an earlier contact as part of the background."""
        return all(self._untouched[side] >= self._settings["untouched_frames"] for side in SIDES)

    def _describe(self) -> tuple[bytes, str, dict]:
        values = {"pinches": self._pinched, "awaited": len(self._pace.awaited)}
        return diagnostics.OK, "" if self._ready else "it waits for images of the untouched sensors", values

    def _on_contact(self, side: str, contact: TactileContact) -> None:
        self._untouched[side] += not contact.in_contact

    def _on_modes(self, modes: PoseModes) -> None:
        self._modes = modes

    def _look(self) -> None:
        """Publish another image while nothing moves, so that a lost answer is not awaited for ever."""
        if not self._ready or self._pace.at_rest:
            self._publish(self._gripper.now)

    def _on_filter(self, status: FilterStatus) -> None:
        if not self._pace.answered(status):
            return
        self._state = status.state
        while self._ready and self._pace.free and not self._over:
            if (pose := next(self._way, None)) is not None:
                self._publish(pose)
            elif self._pace.awaited:
                return
            else:
                self._judge()

    def _judge(self) -> None:
        """Say how far the filter is off after a pinch, and begin the next one."""
        self._pinched += 1
        millimetres, degrees = self._error()
        off = f"{millimetres:.1f} mm, {degrees:.1f} deg from the truth"
        self.get_logger().info(f"pinch {self._pinched}: {self._state}, the pose {off}")
        sure = self._state == FilterStatus.STATE_CONVERGED
        self._over = sure or self._pinched == self._settings["pinches"]
        if self._over:
            self.gave_up = not (sure and millimetres < _NEAR_MM)
            self._on_end()
        self._way = chain(self._gripper.release(), self._gripper.pinch())

    def _error(self) -> tuple[float, float]:
        """Return the error [mm, deg] of the first gel's pose on the object; infinite without an estimate."""
        modes, now = self._modes, self._gripper.now
        if not modes.modes:
            return np.inf, np.inf
        centre, axis = (np.array([v.x, v.y, v.z]) for v in (modes.symmetry_centre, modes.symmetry_axis))
        alike = Symmetry(np.array([transform_from_msg(t) for t in modes.symmetries]), modes.symmetry_free, axis, centre)
        truth = se3.inverse(now.base_from_object) @ now.base_from_gripper @ now.gripper_from_gels[0]
        found = se3.inverse(pose_from_msg(modes.modes[0].pose.pose)) @ now.gripper_from_gels[0]
        distance, angle = pose_errors(alike.nearest(found[None], truth), truth)
        return 1e3 * float(distance[0]), float(np.degrees(angle[0]))

    def _publish(self, now: Gripped) -> None:
        base, gripper, object_ = self._frames
        gels = zip(SIDES, now.gripper_from_gels, strict=True)
        self._pace.publish(
            [
                (base, gripper, now.base_from_gripper),
                (base, object_, now.base_from_object),
                *((gripper, f"{side}_{GEL_FRAME}", pose) for side, pose in gels),
            ]
        )


def main(args: list[str] | None = None) -> int:
    """Entry point of the executable `simulated_gripper`."""
    return spin.run(lambda: [SimulatedGripperNode(spin.stop)], args)


if __name__ == "__main__":
    sys.exit(main())
