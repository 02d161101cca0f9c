"""Node `mujoco_arm`: a simulated UR that follows twists and presses on an object, in a time of its own."""

from __future__ import annotations

import math
import time

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped, Wrench, WrenchStamped
from rclpy.clock import Clock, ClockType
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header
from tf2_msgs.msg import TFMessage

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_common.ros import qos, spin
from midastouch_common.ros.addresses import load_mesh
from midastouch_common.ros.conversions import stamp_from_ns, stamped_transform
from midastouch_common.ros.goals import pose_in
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_motion.nodes.twist_topic import twist_of, vectors
from midastouch_motion.ur.rtde import JOINT_NAMES
from midastouch_motion.ur.tcp_twist import TwistLimits
from midastouch_msgs.msg import TactileContact
from midastouch_msgs.srv import CheckReach
from midastouch_perception.sensor_model import SensorModel

from ..gel_layer import Gel
from ..mujoco_arm import NOT_REACHED, MujocoArm, Setting, over

PARAMETERS = (
    Parameter("mesh", "", "Mesh of the object, metres: a path or package://NAME/...; must be given"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor, as of digit_sim"),
    Parameter("base_frame_id", "base_link", "Frame of the arm's base"),
    Parameter("sensor_frame_id", "digit_gel_frame", "Gel frame by the drawing, which follows the twists"),
    Parameter("true_sensor_frame_id", "digit_gel_ground_truth", "Gel frame where it really is: digit_sim's"),
    Parameter("object_frame_id", "object_ground_truth", "Frame of the object where it really is, as of digit_sim"),
    Parameter(
        "object_pose",
        [0.45, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0],
        "Of the object in the base frame at first: x y z [m], quaternion x y z w",
    ),
    Parameter("above", 0.01, "How far over the object the gel begins", unit="m", minimum=1e-3, maximum=0.3),
    Parameter("mount_error", [0.0] * 6, "Of the gel, off its drawing: x y z [m], turn about them [rad]"),
    Parameter("friction", 0.5, "Of gel on object", minimum=0.0, maximum=2.0),
    Parameter("holding", 0.0, "The object gives way to more; 0: it never does", unit="N", minimum=0.0, maximum=1e3),
    Parameter("latency", 0.05, "From a twist to the motion", unit="s", minimum=0.0, maximum=0.5),
    Parameter("timeout", 0.1, "It stops after this time without a twist", unit="s", minimum=0.01, maximum=10.0),
    Parameter("rate", 125.0, "Transforms per second", unit="Hz", minimum=10.0, maximum=500.0),
    Parameter(
        "longest_delay",
        0.08,
        "Time runs at most this far past the newest `tactile/contact`: a slow machine has a slow arm; 0: no limit",
        unit="s",
        minimum=0.0,
        maximum=10.0,
    ),
)
_GONE = 2.0  # s without a contact: the node that measured them is gone, and time no longer waits for it


class MujocoArmNode(PipelineNode):
    """Node whose arm moves by the twists on `delta_twist_cmds`, in the gel frame. TF has its pose, `/clock` its time.

    Because it cannot hurt anybody, it enables the node `contact_controller` itself, in place of a person.
    """

    def __init__(self, **node_options):
        super().__init__("mujoco_arm", **node_options)
        self._settings = p = Parameters(self, PARAMETERS)
        mesh, sensor = load_mesh(p["mesh"]), SensorModel.load(p["sensor_model"])
        base_from_object = se3.from_xyzquat(np.array(p["object_pose"]))
        start, mount = over(mesh, base_from_object, p["above"]), se3.exp(np.array(p["mount_error"]))
        gel, holding = Gel(friction=p["friction"]), p["holding"] or math.inf
        setting = Setting(base_from_object, start, mount, gel, holding, p["latency"], p["timeout"])
        self._arm = MujocoArm(mesh, sensor, setting)
        self._limits = TwistLimits(p["sensor_frame_id"], math.inf, math.inf)  # the joints have limits of their own
        self._began, self._period = time.time_ns(), 1.0 / p["rate"]
        self._behind, self._contact = time.monotonic(), (-math.inf, time.monotonic())
        self._tf = self.create_publisher(TFMessage, "/tf", qos.TF)
        self._time = self.create_publisher(ClockMessage, "/clock", qos.stream_publisher(10))
        self._joints = self.create_publisher(JointState, "joint_states", qos.stream_publisher())
        self._enable = self.create_publisher(Bool, "contact_controller/enable", qos.COMMAND)
        self._wrench = self.create_publisher(WrenchStamped, "wrench", qos.stream_publisher())
        self.create_subscription(TwistStamped, "delta_twist_cmds", self._on_twist, qos.stream_subscriber(10))
        self.create_subscription(TactileContact, "tactile/contact", self._on_contact, qos.stream_subscriber(10))
        self.create_service(CheckReach, "~/check_reach", self._on_check_reach)
        self.create_timer(self._period, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_twist(self, msg: TwistStamped) -> None:
        twist = twist_of(msg)
        if refusal := self._limits.refusal(msg.header.frame_id, twist):
            self.get_logger().warning(refusal)
        else:
            self._arm.command(self._arm.time, twist)

    def _on_contact(self, msg: TactileContact) -> None:
        self._contact = (stamp_ns(msg.header.stamp) - self._began) / SECOND, time.monotonic()

    def _on_check_reach(self, request: CheckReach.Request, response: CheckReach.Response) -> CheckReach.Response:
        header, base = request.poses.header, self._settings["base_frame_id"]
        try:
            poses = [pose_in(PoseStamped(header=header, pose=pose), base) for pose in request.poses.poses]
        except InputError as error:
            response.message = str(error)
            return response
        response.reachable = self._arm.reaches(np.reshape(poses, (-1, 4, 4))).tolist()
        if not all(response.reachable):
            response.message = NOT_REACHED
        return response

    def _on_timer(self) -> None:
        """Advance as far as the machine's time has, but not too far beyond the newest measurement."""
        now = time.monotonic()
        newest, heard = self._contact
        most = self._settings["longest_delay"]
        follows = math.isfinite(newest) and most > 0 and now - heard < _GONE
        ahead = min(now - self._behind, 2 * self._period)
        self._behind = now
        if follows:
            ahead = min(ahead, newest + most - self._arm.time)
        if ahead > 0:
            self._arm.advance(self._arm.time + ahead)
            self._publish()
            if self._arm.stopped:
                self.get_logger().error(
                    "protective stop: the arm has met the table or its sensor; start again", once=True
                )

    def _publish(self) -> None:
        arm, p = self._arm, self._settings
        stamp = stamp_from_ns(self._began + round(arm.time * SECOND))
        self._time.publish(ClockMessage(clock=stamp))
        self._enable.publish(Bool(data=True))
        poses = (
            (p["base_frame_id"], p["sensor_frame_id"], arm.pose),
            (p["base_frame_id"], p["object_frame_id"], arm.base_from_object),
            (p["object_frame_id"], p["true_sensor_frame_id"], arm.gel_on_object),
        )
        self._tf.publish(TFMessage(transforms=[stamped_transform(stamp, *each) for each in poses]))
        positions, velocities = (each.tolist() for each in arm.joints)
        header = Header(stamp=stamp)
        self._joints.publish(JointState(header=header, name=JOINT_NAMES, position=positions, velocity=velocities))
        force, torque = vectors(arm.wrench)
        header = Header(stamp=stamp, frame_id=p["sensor_frame_id"])
        self._wrench.publish(WrenchStamped(header=header, wrench=Wrench(force=force, torque=torque)))


def main(args=None) -> int:
    """Entry point of the executable `mujoco_arm`."""
    return spin.run(lambda: [MujocoArmNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())
