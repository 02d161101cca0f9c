"""Node `slider`: an arm touches, slides and lifts, by twists that follow what the sensor measures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped, Vector3
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool, Header

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import points_from_msg, stamp_ns
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_common.ros.managed_node import AUTOSTART, ManagedNode
from midastouch_common.ros.parameters import Parameter
from midastouch_filter.nodes.transform_source import TransformSource
from midastouch_filter.transforms import SECOND, TransformError
from midastouch_filter.transforms.queue import Wait
from midastouch_msgs.action import Lift, Slide, Touch
from midastouch_msgs.msg import FilterStatus, TactileContact

from .. import skills
from ..contact_servo import ContactServo, Limits, Measured, slope_of
from ..controller import Controller
from ..guard import Guard, Seen

_FARTHEST = 0.2  # m, of a touch or a lift
_LONGEST = 2.0  # m, of a slide
_HALVES = 8  # contacts whose points are still to come, or the other way round
_INACTIVE = "the node is not active; activate it (ros2 lifecycle set)"

PARAMETERS = (
    Parameter("base_frame_id", "base_link", "Frame at rest, in which the box is"),
    Parameter("sensor_frame_id", "digit_gel_frame", "Gel frame, whose twists are commanded"),
    Parameter("depth", 5e-4, "How deep the gel is held, if a goal does not say", unit="m", minimum=1e-4, maximum=2e-3),
    Parameter("max_depth", 1e-3, "A gel that gets deeper is pulled back", unit="m", minimum=2e-4, maximum=3e-3),
    Parameter("speed", 0.01, "Fastest motion in contact", unit="m/s", minimum=1e-4, maximum=0.1),
    Parameter("air_speed", 0.02, "Fastest motion in the air", unit="m/s", minimum=1e-4, maximum=0.25),
    Parameter("turn_speed", 0.5, "Fastest turn", unit="rad/s", minimum=0.01, maximum=2.0),
    Parameter(
        "acceleration", 0.2, "Fastest change of speed; a stop is at once", unit="m/s^2", minimum=0.01, maximum=5.0
    ),
    Parameter("box_low", [-1.0, -1.0, -1.0], "Corner of the box in the base frame that the gel keeps to", unit="m"),
    Parameter("box_high", [1.0, 1.0, 1.5], "Its opposite corner", unit="m"),
    Parameter("rate", 100.0, "Twists per second", unit="Hz", minimum=20.0, maximum=1000.0, at_start=True),
    Parameter("arm_latency", 0.05, "From a twist to the motion of the arm", unit="s", minimum=0.0, maximum=0.5),
    Parameter("hold", 0.1, "How long an `enable` holds", unit="s", minimum=0.02, maximum=10.0),
    Parameter(
        "stale_after", 0.1, "Images and transforms older than this stop the arm", unit="s", minimum=0.02, maximum=10.0
    ),
    Parameter("queue_depth", 1, "Messages kept while the node is busy", minimum=1, maximum=10000, at_start=True),
    AUTOSTART,
)


class Slider(ManagedNode):
    """While active, carries out one goal of `touch`, `slide` or `lift` at a time, as long as `~/enable` is repeated.

    Twists of the gel, in its own frame, are on `delta_twist_cmds` while a goal is carried out, and two of zero after
    it.
    """

    _goal: tuple[ServerGoalHandle, type] | None = None
    _servers: Sequence[ActionServer] = ()

    def __init__(self, **node_options):
        super().__init__("slider", PARAMETERS, **node_options)
        self._twists = self.create_publisher(TwistStamped, "delta_twist_cmds", qos.stream_publisher())
        self._make = {Touch: self._touch, Slide: self._slide, Lift: self._lift}
        self._servers = [
            ActionServer(
                self,
                kind,
                kind.__name__.lower(),
                execute_callback=lambda goal: None,  # `_end` names another one
                handle_accepted_callback=lambda goal, kind=kind: self._on_goal(goal, kind),
                cancel_callback=self._on_cancel,
            )
            for kind in self._make
        ]
        self._ended, self._more_zeros = "", 0
        self._transforms: TransformSource | None = None
        self.autostart()

    def configure(self) -> None:
        """Check the limits."""
        p = self.parameters
        if p["depth"] >= p["max_depth"]:
            raise InputError(f"parameter depth: {p['depth']:g} m is not less than max_depth, {p['max_depth']:g} m")
        limits = Limits(p["speed"], p["air_speed"], p["turn_speed"], p["acceleration"], p["max_depth"])
        box = np.array(p["box_low"]), np.array(p["box_high"])
        guard = Guard(*box, p["max_depth"], p["hold"], p["stale_after"])
        self._controller = Controller(ContactServo(limits, p["arm_latency"]), guard)
        self._seen, self._area = Seen(), 0.0
        self._halves: dict[int, dict[type, TactileContact | PointCloud2]] = {}  # by stamp [ns]

    def unload(self) -> None:
        """Nothing is loaded."""

    def connect(self) -> None:
        """Listen to contacts, clouds, the filter, TF and `~/enable`."""
        depth = self.parameters["queue_depth"]
        self._seen = Seen()
        self.create_subscription(Bool, "~/enable", self._on_enable, qos.COMMAND)
        self.create_subscription(TactileContact, "tactile/contact", self._on_contact, qos.stream_subscriber(depth))
        self.create_subscription(PointCloud2, "tactile/points", self._on_points, qos.stage_subscriber(depth, False))
        self.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched())
        self.create_timer(1.0 / self.parameters["rate"], self._on_timer)
        self._frames = self.parameters["base_frame_id"], self.parameters["sensor_frame_id"]
        # last: it has a thread, which nobody would end if something before it failed
        self._transforms = TransformSource(
            self,
            frames=self._frames,
            on_update=lambda: None,
            on_jump=lambda stamp: self._on_time_jump(),
            on_bad=lambda reason: self.diagnostics.problem("bad_transforms", reason),
        )

    def disconnect(self) -> None:
        """Stop the arm, and reading TF."""
        self._stop("the node was deactivated")
        if self._transforms is not None:
            self._transforms.close()
            self._transforms = None

    def destroy_node(self) -> None:
        """As of every node; the arm stops, but a goal cannot be ended any more."""
        if self._goal is not None:
            self._publish(self._controller.cancel(self._now()))
            self._goal = None
        for server in self._servers:
            server.destroy()
        super().destroy_node()

    def describe(self) -> tuple[bytes, str, dict]:
        """Level, message and values for the diagnostics."""
        servo = self._controller.servo
        self._look()
        values = {
            "in_the_way": self._controller.guard.problem(self._now(), self._seen) or "nothing",
            "delay_ms": f"{1e3 * servo.delay:.0f}",
            "depth_mm": f"{1e3 * servo.depth:.2f}",
            "motion": "none" if self._goal is None else self._goal[1].__name__.lower(),
            "last_motion": self._ended,
        }
        return diagnostics.OK, "", values

    # --- what is seen

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds / SECOND

    def _on_enable(self, msg: Bool) -> None:
        self._seen.enabled = self._now() if msg.data else -math.inf

    def _on_status(self, msg: FilterStatus) -> None:
        self._seen.lost = msg.state == FilterStatus.STATE_LOST

    def _on_contact(self, msg: TactileContact) -> None:
        if not (0 <= msg.depth < math.inf and 0 <= msg.area < math.inf):
            self.diagnostics.problem("bad_contacts", f"tactile/contact: {msg.depth:g} m deep, {msg.area:g} m^2")
            return
        self._half(msg, msg.header if msg.in_contact else None)

    def _on_points(self, msg: PointCloud2) -> None:
        self._half(msg, msg.header)

    def _half(self, msg: TactileContact | PointCloud2, of: Header | None) -> None:
        """A contact or its points; `of`: what the other half comes with, None if nothing else is needed."""
        if of is None:
            self._measure(msg, np.zeros((0, 3)))
            return
        stamp = stamp_ns(of.stamp)
        halves = self._halves.setdefault(stamp, {})
        halves[type(msg)] = msg
        if len(halves) == 2:
            del self._halves[stamp]
            try:
                points = points_from_msg(halves[PointCloud2])
                if not np.isfinite(points).all():
                    raise InputError("points that are not finite")
                self._measure(halves[TactileContact], points)
            except InputError as error:
                self.diagnostics.problem("bad_clouds", f"tactile/points: {error}")
        while len(self._halves) > _HALVES:
            del self._halves[next(iter(self._halves))]

    def _measure(self, contact: TactileContact, points: np.ndarray) -> None:
        """A contact and its points (K, 3)."""
        stamp = stamp_ns(contact.header.stamp) / SECOND
        if stamp <= self._seen.image:
            return
        depth = contact.depth if contact.in_contact else 0.0
        self._controller.servo.measure(self._now(), Measured(stamp, depth, slope_of(points)))
        self._seen.image, self._area = stamp, float(contact.area)
        if self._goal is not None:
            self._feed_back()

    def _look(self) -> None:
        """Where the gel is, and who is on the topic of the twists."""
        try:
            newest = self._transforms.latest_stamp(*self._frames)
            stamp = self.get_clock().now().nanoseconds if newest is None else newest
            pose = self._transforms.lookup(*self._frames, stamp)
        except TransformError:
            return
        if not isinstance(pose, Wait):
            self._seen.pose, self._seen.position = stamp / SECOND, pose[:3, 3]
        topic = self._twists.topic_name
        self._seen.listeners, self._seen.commanders = self.count_subscribers(topic), self.count_publishers(topic)

    # --- goals

    def _on_goal(self, goal: ServerGoalHandle, kind: type) -> None:
        try:
            if not self.active:
                raise InputError(_INACTIVE)
            if self._goal is not None:
                raise InputError(f"the arm is carrying out a {self._goal[1].__name__.lower()}; cancel it first")
            skill = self._make[kind](goal.request)
        except InputError as error:
            self._finish(goal, kind, skills.Ended(False, str(error)), 0.0)
            return
        self._goal = goal, kind
        self._controller.begin(skill)

    def _on_cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        # it is being cancelled only once this has returned
        self.executor.create_task(lambda: self._cancel(goal))
        return CancelResponse.ACCEPT

    def _cancel(self, goal: ServerGoalHandle) -> None:
        if self._goal is not None and self._goal[0] is goal:
            self._stop("cancelled")

    def _stop(self, reason: str) -> None:
        if self._goal is not None:
            path = self._controller.path
            self._publish(self._controller.cancel(self._now()))
            self._end(skills.Ended(False, reason), path)

    def _on_time_jump(self) -> None:
        """What was measured and commanded has no meaning any more."""
        self._stop("time ran back")
        self.configure()

    def _touch(self, request: Touch.Goal) -> skills.Touch:
        d = np.array([request.direction.x, request.direction.y, request.direction.z])
        if not np.isfinite(d).all():
            raise InputError("direction: not finite")
        direction = d if np.linalg.norm(d) > 0 else None
        return skills.Touch(self._depth(request), _checked("distance", request.distance, _FARTHEST), direction)

    def _slide(self, request: Slide.Goal) -> skills.Slide:
        if not math.isfinite(request.heading):
            raise InputError("heading: not finite")
        return skills.Slide(request.heading, _checked("length", request.length, _LONGEST), self._depth(request))

    def _lift(self, request: Lift.Goal) -> skills.Lift:
        return skills.Lift(_checked("height", request.height, _FARTHEST))

    def _depth(self, request: Any) -> float:
        most = self.parameters["max_depth"]
        if not 0 <= request.depth < most:
            raise InputError(f"depth {request.depth:g} is not between 0 and max_depth, {most:g} m; 0 is the default")
        return request.depth or self.parameters["depth"]

    # --- motion

    def _on_timer(self) -> None:
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
        linear, angular = (Vector3(**dict(zip("xyz", each, strict=True))) for each in twist.reshape(2, 3).tolist())
        message = TwistStamped(header=Header(stamp=self.get_clock().now().to_msg(), frame_id=self._frames[1]))
        message.twist.linear, message.twist.angular = linear, angular
        self._twists.publish(message)

    def _feed_back(self) -> None:
        goal, kind = self._goal
        servo = self._controller.servo
        header = Header(stamp=stamp_from_ns(round(servo.stamp * SECOND)), frame_id=self._frames[1])
        goal.publish_feedback(
            kind.Feedback(header=header, path=self._controller.path, depth=servo.depth, area=self._area)
        )

    def _end(self, how: skills.Ended, path: float) -> None:
        (goal, kind), self._goal = self._goal, None
        self._ended, self._more_zeros = how.message, 1
        self.get_logger().info(f"{kind.__name__.lower()}: {how.message}")
        self._finish(goal, kind, how, path)

    def _finish(self, goal: ServerGoalHandle, kind: type, how: skills.Ended, path: float) -> None:
        depth = self._controller.servo.depth if self.active else 0.0

        def finish(goal: ServerGoalHandle) -> Any:
            if goal.is_cancel_requested:
                goal.canceled()
            elif how.success:
                goal.succeed()
            else:
                goal.abort()
            return kind.Result(success=how.success, message=how.message, path=path, depth=depth)

        goal.execute(finish)


def _checked(name: str, value: float, most: float) -> float:
    if not 0 < value <= most:
        raise InputError(f"{name} {value:g} is not between 0 and {most:g} m")
    return value


def main(args: Callable | None = None) -> int:
    """Entry point of the executable `slider`."""
    return spin.run(lambda: [Slider()], args)


if __name__ == "__main__":
    raise SystemExit(main())
