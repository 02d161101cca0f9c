"""A test's own sensor, arm and operator around the node `contact_controller`."""

from __future__ import annotations

import time

import numpy as np
from geometry_msgs.msg import TwistStamped, Vector3, Wrench, WrenchStamped
from goals import Asked
from rclpy.duration import Duration
from ros_graph import RosGraph
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool, Header
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg

from midastouch_common import se3
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import points_to_msg
from midastouch_motion.nodes.contact_controller import ContactController
from midastouch_msgs.msg import TactileContact

_PERIOD = 0.03  # s
PATIENT = {"hold": 10.0, "stale_after": 10.0}
"""A busy machine may be late: where that is not what a test is about."""


class Rig:
    """With `use_sim_time`, the time that stamps are of is on `/clock`.

    Attributes: twists, that have come; enabled, images, poses, forces: whether these are sent; follows, whether the
    arm goes along with the twists; depth [m]; state of the contact; force (3,) [N], or its z, along the axes of
    `felt_in`, a frame; late [s], of the stamps; bad, what is not finite."""

    def __init__(self, graph: RosGraph, **parameters):
        self.graph = graph
        self.node = graph.add(ContactController, PATIENT | parameters)
        self._enable = graph.publisher(Bool, "contact_controller/enable", qos.COMMAND)
        self._contact = graph.publisher(TactileContact, "tactile/contact", qos.stream_publisher())
        self._points = graph.publisher(PointCloud2, "tactile/points", qos.stage_publisher())
        topic = parameters.get("wrench_topic", "wrench")
        self._wrench = graph.publisher(WrenchStamped, topic, qos.stream_publisher()) if topic else None
        self._tf = graph.publisher(TFMessage, "/tf", qos.TF)
        self._clock = graph.publisher(Clock, "/clock", qos.TF) if parameters.get("use_sim_time") else None
        self.twists = graph.listen(TwistStamped, "delta_twist_cmds")
        self.enabled = self.images = self.poses = self.forces = self.follows = True
        self.late, self.bad, self.state, self.felt_in = 0.0, "", "", "digit_gel_frame"
        self.depth, self.force, self.position, self._sent = 0.0, 0.0, np.zeros(3), 0.0

    def send(self) -> None:
        """An image, pose, force and `enable`, as far as they are sent, if the last ones are so old."""
        if time.monotonic() - self._sent < _PERIOD:
            return
        if self.follows and self._sent and self.twists:
            linear = self.twists[-1].twist.linear
            self.position = self.position + (time.monotonic() - self._sent) * np.array([linear.x, linear.y, linear.z])
        self._sent = time.monotonic()
        now = (self.graph.companion.get_clock().now() - Duration(seconds=self.late)).to_msg()
        gel = Header(stamp=now, frame_id="digit_gel_frame")
        if self._clock is not None:
            self._clock.publish(Clock(clock=now))
        if self.enabled:
            self._enable.publish(Bool(data=True))
        if self.poses:
            self._tf.publish(tf_msg(stamp_ns(now), se3.translation(self.position)))
        if self.forces and self._wrench is not None:
            x, y, z = (0.0, 0.0, self.force) if np.isscalar(self.force) else self.force
            felt = Header(stamp=now, frame_id=self.felt_in)
            self._wrench.publish(WrenchStamped(header=felt, wrench=Wrench(force=Vector3(x=x, y=y, z=z))))
        if self.images:
            touches = self.depth > 0
            area = 2e-5 if touches else 0.0
            depth = np.nan if self.bad == "depth" else self.depth
            contact = TactileContact(header=gel, in_contact=touches, state=self.state, area=area, depth=depth)
            self._contact.publish(contact)
            points = np.random.default_rng(0).uniform(-3e-3, 3e-3, (50, 3)) * (1, 1, 0)
            points[0, 2] = np.nan if self.bad == "points" else 0.0
            self._points.publish(points_to_msg(points if touches else np.zeros((0, 3)), gel))

    def until(self, done, what: str) -> None:
        """Go on sending until that."""

        def step() -> bool:
            self.send()
            return done()

        self.graph.spin_until(step, what)

    def ask(self, kind: type, **goal) -> Motion:
        """Send a goal."""
        if self.node.active and self.enabled and self.forces:  # sensor, arm and operator were there before
            self.until(lambda: self.node.describe()[2]["in_the_way"] == "nothing", "all to be seen")
        return Motion(self, kind, **goal)


class Motion(Asked):
    """A goal while which the rig goes on sending."""

    def __init__(self, rig: Rig, kind: type, **goal):
        super().__init__(rig.graph.companion, rig.until, kind, **goal)
        self._rig = rig

    def moves(self) -> Motion:
        """Itself, once the arm is told to move."""
        before = len(self._rig.twists)
        self._rig.until(lambda: any(moving(twist) for twist in self._rig.twists[before:]), "a motion")
        return self


def moving(message: TwistStamped) -> bool:
    """Whether it is no stop."""
    twist = message.twist
    return any(getattr(each, axis) for each in (twist.linear, twist.angular) for axis in "xyz")
