"""Node `contact_controller`: an arm touches, slides and lifts, by twists that follow from the sensor's measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.action.server import ServerGoalHandle
from std_msgs.msg import Header

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.conversions import stamp_from_ns, stamped_pose
from midastouch_common.ros.goals import GoalServer, end_goal, name_of
from midastouch_common.ros.managed_node import INACTIVE, ManagedNode
from midastouch_perception.sensor_model import SensorModel

from ..control import skills
from .arm_actions import KINDS
from .contact_controller_parameters import PARAMETERS, controller_of
from .controller_inputs import Inputs
from .goal_skill import skill_of
from .twist_topic import vectors


class ContactController(ManagedNode):
    """Node that, while active, carries out goals of `touch`, `slide`, `lift` and `approach` while `~/enable` repeats.

    During a goal it publishes twists of the gel, in the gel's frame, on `delta_twist_cmds`; then two of zero, or one
    if the node ends.
    """

    _goal: tuple[ServerGoalHandle, type[Any]] | None = None
    _servers: Sequence[GoalServer] = ()
    _inputs: Inputs | None = None  # while active
    _waits_for: str | None = None  # what was in the way of the first motion when last said; None: nothing is any more

    def __init__(self, **node_options) -> None:
        super().__init__("contact_controller", PARAMETERS, **node_options)
        self._twists = self.create_publisher(TwistStamped, "delta_twist_cmds", qos.stream_publisher())
        self._servers = [
            GoalServer(self, kind, name_of(kind), partial(self._on_goal, kind=kind), self._on_cancel)
            for kind in KINDS.values()
        ]
        self._ended, self._more_zeros, self._ticked = "", 0, -math.inf  # s: last period
        self.autostart()

    def configure(self) -> None:
        """Check the limits, and make the controller."""
        self._controller = controller_of(self.parameters, self.get_parameter("use_sim_time").value)
        self._sensor = SensorModel.load(self.parameters["sensor_model"])

    def unload(self) -> None:
        """Do nothing: nothing is loaded."""

    def connect(self) -> None:
        """Listen to contacts, clouds, forces, the filter, TF and `~/enable`."""
        self._more_zeros, self._ticked, self._waits_for = 0, -math.inf, "not looked yet"
        self._frames = self.parameters["base_frame_id"], self.parameters["sensor_frame_id"]
        self.create_timer(1.0 / self.parameters["rate"], self._on_timer)
        self._inputs = Inputs(self, self._controller, self._sensor, self._frames, self._feed_back, self._on_time_jump)

    def disconnect(self) -> None:
        """Stop the arm, and stop reading TF."""
        self._stop("the node was deactivated")
        if self._inputs is not None:
            self._inputs.close()
            self._inputs = None

    def destroy_node(self) -> None:
        """Stop the arm and destroy the node; a goal can no longer be ended."""
        if self._goal is not None:
            self._publish(self._controller.cancel(self._now()))
            self._goal = None
        for server in self._servers:
            server.close()
        super().destroy_node()

    def describe(self) -> tuple[bytes, str, dict]:
        """Return level, message and values for the diagnostics."""
        servo = self._controller.servo
        self._inputs.look(self._twists.topic_name)
        problem = self._controller.guard.problem(self._now(), self._inputs.seen)
        if self._waits_for not in (None, problem):
            self.get_logger().info(f"no motion can begin: {problem}" if problem else "ready for motions")
            self._waits_for = problem or None
        values = {
            "in_the_way": problem or "nothing",
            "delay_ms": f"{1e3 * servo.delay:.0f}",
            "depth_mm": f"{1e3 * servo.depth:.2f}",
            **self._controller.wrench.describe(),
            "motion": "none" if self._goal is None else name_of(self._goal[1]),
            "last_motion": self._ended,
        }
        return diagnostics.OK, "", values

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds / SECOND

    # --- goals

    def _on_goal(self, goal: ServerGoalHandle, kind: type[Any]) -> None:
        try:
            if not self.active:
                raise InputError(INACTIVE)
            if self._goal is not None:
                raise InputError(f"the arm is carrying out a {name_of(self._goal[1])}; cancel it first")
            skill = skill_of(goal.request, self.parameters)
        except InputError as error:
            self._finish(goal, kind, skills.SkillEnd(False, str(error)), 0.0)
            return
        self._goal = goal, kind
        self._controller.begin(skill)

    def _on_cancel(self, goal: ServerGoalHandle) -> None:
        if self._goal is not None and self._goal[0] is goal:
            self._stop("cancelled")

    def _stop(self, reason: str) -> None:
        if self._goal is not None:
            path = self._controller.path
            self._publish(self._controller.cancel(self._now()))
            self._end(skills.SkillEnd(False, reason), path)

    def _on_time_jump(self) -> None:
        """Forget everything measured and commanded, because time ran back."""
        self._inputs.forget()  # first, so that the result has no old pose of the gel
        self._stop("time ran back")
        self.configure()
        self._inputs.controller, self._ticked = self._controller, -math.inf

    # --- motion

    def _on_timer(self) -> None:
        before, self._ticked = self._ticked, self._now()
        if self._ticked < before:
            self._on_time_jump()
        if self._goal is None:
            if self._more_zeros:
                self._more_zeros -= 1
                self._publish(np.zeros(6))
            return
        self._inputs.look(self._twists.topic_name)
        path = self._controller.path
        twist, ended = self._controller.step(self._now(), self._inputs.seen)
        self._publish(twist)
        if ended is not None:
            self._end(ended, path)

    def _publish(self, twist: np.ndarray) -> None:
        message = TwistStamped(header=Header(stamp=self.get_clock().now().to_msg(), frame_id=self._frames[1]))
        message.twist.linear, message.twist.angular = vectors(twist)
        self._twists.publish(message)

    def _feed_back(self) -> None:
        if self._goal is None:
            return
        goal, kind = self._goal
        servo = self._controller.servo
        header = Header(stamp=stamp_from_ns(round(servo.stamp * SECOND)), frame_id=self._frames[1])
        goal.publish_feedback(
            kind.Feedback(header=header, path=self._controller.path, depth=servo.depth, area=self._inputs.area)
        )

    def _end(self, how: skills.SkillEnd, path: float) -> None:
        (goal, kind), self._goal = self._goal, None
        self._ended, self._more_zeros = how.message, 1
        self.get_logger().info(f"{name_of(kind)}: {how.message}")
        self._finish(goal, kind, how, path)

    def _finish(self, goal: ServerGoalHandle, kind: type[Any], how: skills.SkillEnd, path: float) -> None:
        depth = self._controller.servo.depth if self._inputs is not None else 0.0
        result = kind.Result(success=how.success, message=how.message, path=path, depth=depth)
        if self._inputs is not None and math.isfinite(self._inputs.pose):
            stamp = stamp_from_ns(round(self._inputs.pose * SECOND))
            result.pose = stamped_pose(self._frames[0], self._inputs.seen.gel, stamp)
        end_goal(goal, how.success, result)


def main(args=None) -> int:
    """Entry point of the executable `contact_controller`."""
    return spin.run(lambda: [ContactController()], args)


if __name__ == "__main__":
    raise SystemExit(main())
