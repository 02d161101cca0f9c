"""Node `contact_controller`: an arm touches, slides and lifts, by twists that follow from the sensor's measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped, WrenchStamped
from rclpy.action.server import ServerGoalHandle
from std_msgs.msg import Bool, Header

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.conversions import stamp_from_ns, stamped_pose
from midastouch_common.ros.goals import GoalServer, end_goal, name_of
from midastouch_common.ros.managed_node import INACTIVE, ManagedNode
from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.queue import Wait
from midastouch_common.transforms.rigid import TransformError
from midastouch_msgs.msg import FilterStatus, TactileContact
from midastouch_perception.sensor_model import SensorModel

from ..control import skills
from ..control.contact_servo import Measured
from ..control.guard import UNREAD, Seen
from ..control.wrench import Sample
from .arm_actions import KINDS
from .contact_controller_parameters import PARAMETERS, controller_of
from .goal_skill import skill_of
from .touch_images import TouchImages
from .twist_topic import followers_and_commanders, vectors


class ContactController(ManagedNode):
    """Node that, while active, carries out goals of `touch`, `slide`, `lift` and `approach` while `~/enable` repeats.

    During a goal it publishes twists of the gel, in the gel's frame, on `delta_twist_cmds`; then two of zero, or one
    if the node ends.
    """

    _goal: tuple[ServerGoalHandle, type[Any]] | None = None
    _servers: Sequence[GoalServer] = ()

    def __init__(self, **node_options) -> None:
        super().__init__("contact_controller", PARAMETERS, **node_options)
        self._twists = self.create_publisher(TwistStamped, "delta_twist_cmds", qos.stream_publisher())
        self._servers = [
            GoalServer(self, kind, name_of(kind), partial(self._on_goal, kind=kind), self._on_cancel)
            for kind in KINDS.values()
        ]
        self._seen, self._ended, self._more_zeros = Seen(), "", 0
        self._transforms: TransformSource | None = None
        self.autostart()

    def configure(self) -> None:
        """Check the limits, and make the controller."""
        self._controller = controller_of(self.parameters, self.get_parameter("use_sim_time").value)
        self._sensor = SensorModel.load(self.parameters["sensor_model"])
        self._forget()

    def unload(self) -> None:
        """Do nothing: nothing is loaded."""

    def connect(self) -> None:
        """Listen to contacts, clouds, forces, the filter, TF and `~/enable`."""
        self._forget()
        self._more_zeros = 0
        self.create_subscription(Bool, "~/enable", self._on_enable, qos.COMMAND)
        TouchImages(self, self.parameters["queue_depth"], self._measure)
        self.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched())
        if topic := self.parameters["wrench_topic"]:
            self.create_subscription(WrenchStamped, topic, self._on_wrench, qos.stream_subscriber())
        self.create_timer(1.0 / self.parameters["rate"], self._on_timer)
        self._frames = self.parameters["base_frame_id"], self.parameters["sensor_frame_id"]
        # last: nothing would end its thread if something after it failed
        self._transforms = TransformSource(
            self,
            frames=self._frames,
            on_jump=lambda stamp: self._on_time_jump(),
            on_bad=lambda reason: self.diagnostics.problem("bad_transforms", reason),
        )

    def disconnect(self) -> None:
        """Stop the arm, and stop reading TF."""
        self._stop("the node was deactivated")
        if self._transforms is not None:
            self._transforms.close()
            self._transforms = None

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
        self._look()
        values = {
            "in_the_way": self._controller.guard.problem(self._now(), self._seen) or "nothing",
            "delay_ms": f"{1e3 * servo.delay:.0f}",
            "depth_mm": f"{1e3 * servo.depth:.2f}",
            **self._controller.wrench.describe(),
            "motion": "none" if self._goal is None else name_of(self._goal[1]),
            "last_motion": self._ended,
        }
        return diagnostics.OK, "", values

    # --- input

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds / SECOND

    def _forget(self) -> None:
        self._seen, self._area = Seen(), 0.0
        # s: newest stamps, of an image or pose however far ahead; last period
        self._image = self._pose = self._force_stamp = self._ticked = -math.inf

    def _on_enable(self, msg: Bool) -> None:
        self._seen.enabled = self._now() if msg.data else -math.inf

    def _on_status(self, msg: FilterStatus) -> None:
        self._seen.lost = self.parameters["stop_if_lost"] and msg.state == FilterStatus.STATE_LOST

    def _on_wrench(self, msg: WrenchStamped) -> None:
        if self._transforms is None:  # deactivated in the same round of the executor
            return
        stamp, now, guard = stamp_ns(msg.header.stamp) / SECOND, self._now(), self._controller.guard
        if stamp <= self._force_stamp:
            return
        self._seen.wrench = guard.counted(now, stamp)
        if guard.early("force", now, stamp):
            return
        self._force_stamp = stamp
        try:
            sample = self._sample(stamp, msg)
        except InputError as error:
            self._seen.bad_wrench = f"wrench_topic: {error}"
            return
        self._seen.bad_wrench = ""
        self._controller.wrench.take(sample)
        self._seen.force = float(np.linalg.norm(self._controller.wrench.force))

    def _sample(self, stamp: float, msg: WrenchStamped) -> Sample:
        """Return the force of a message along the gel's axes; raises InputError if it cannot be used."""
        force = np.array([getattr(msg.wrench.force, axis) for axis in "xyz"])
        if not np.isfinite(force).all():
            raise InputError("the force is not finite")
        (base, gel), frame = self._frames, msg.header.frame_id
        try:
            along = self._transforms.newest(gel, frame)[:3, :3]
            up = self._transforms.newest(gel, base)[:3, 2]
        except TransformError as error:
            raise InputError(f"TF does not link its frame '{frame}' to the gel: {error}") from error
        return Sample(stamp, along @ force, up)

    def _measure(self, contact: TactileContact, points: np.ndarray) -> None:
        """Take a contact and its points (K, 3)."""
        stamp, now = stamp_ns(contact.header.stamp) / SECOND, self._now()
        if early := self._controller.guard.early("image", now, stamp):
            self.diagnostics.problem("early_images", f"tactile/contact: {early}; is the sensor's clock right?")
            return
        if stamp <= self._image:
            return
        depth = contact.depth if contact.in_contact else 0.0
        self._controller.servo.measure(now, Measured.of(stamp, depth, contact.area, points, self._sensor))
        self._image, self._area = stamp, float(contact.area)
        self._seen.unread = UNREAD.get(contact.state, "")
        self._seen.image = self._controller.guard.counted(now, stamp)
        if self._goal is not None:
            self._feed_back()

    def _look(self) -> None:
        """Update the gel's pose, and the numbers of nodes on the topic of the twists."""
        self._seen.listeners, self._seen.commanders = followers_and_commanders(self, self._twists.topic_name)
        try:
            newest = self._transforms.latest_stamp(*self._frames)
            stamp = self.get_clock().now().nanoseconds if newest is None else newest
            pose = self._transforms.lookup(*self._frames, stamp)
        except TransformError:
            return
        if not isinstance(pose, Wait) and stamp / SECOND > self._pose:
            self._pose, self._seen.gel = stamp / SECOND, pose
            self._seen.pose = self._controller.guard.counted(self._now(), self._pose)

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
        self._forget()  # first, so that the result has no old pose of the gel
        self._transforms.forget()
        self._stop("time ran back")
        self.configure()

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
        self._look()
        path = self._controller.path
        twist, ended = self._controller.step(self._now(), self._seen)
        self._publish(twist)
        if ended is not None:
            self._end(ended, path)

    def _publish(self, twist: np.ndarray) -> None:
        message = TwistStamped(header=Header(stamp=self.get_clock().now().to_msg(), frame_id=self._frames[1]))
        message.twist.linear, message.twist.angular = vectors(twist)
        self._twists.publish(message)

    def _feed_back(self) -> None:
        goal, kind = self._goal
        servo = self._controller.servo
        header = Header(stamp=stamp_from_ns(round(servo.stamp * SECOND)), frame_id=self._frames[1])
        goal.publish_feedback(
            kind.Feedback(header=header, path=self._controller.path, depth=servo.depth, area=self._area)
        )

    def _end(self, how: skills.SkillEnd, path: float) -> None:
        (goal, kind), self._goal = self._goal, None
        self._ended, self._more_zeros = how.message, 1
        self.get_logger().info(f"{name_of(kind)}: {how.message}")
        self._finish(goal, kind, how, path)

    def _finish(self, goal: ServerGoalHandle, kind: type[Any], how: skills.SkillEnd, path: float) -> None:
        depth = self._controller.servo.depth if self._transforms is not None else 0.0
        result = kind.Result(success=how.success, message=how.message, path=path, depth=depth)
        if math.isfinite(self._seen.pose):
            stamp = stamp_from_ns(round(self._seen.pose * SECOND))
            result.pose = stamped_pose(self._frames[0], self._seen.gel, stamp)
        end_goal(goal, how.success, result)


def main(args=None) -> int:
    """Entry point of the executable `contact_controller`."""
    return spin.run(lambda: [ContactController()], args)


if __name__ == "__main__":
    raise SystemExit(main())
