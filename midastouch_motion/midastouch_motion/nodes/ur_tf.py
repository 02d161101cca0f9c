"""Node `ur_tf`: tool pose, joints and force of a UR arm that has no ROS driver, over RTDE."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable

from geometry_msgs.msg import Wrench, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common.clock_offset import ClockOffset
from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns, stamped_transform
from midastouch_common.ros.diagnostics import ERROR, OK, Diagnostics
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_common.ros.spin import run
from midastouch_motion.ur.rtde import (
    BASE_LINK_FROM_BASE,
    JOINT_NAMES,
    ArmState,
    RobotClock,
    RtdeReceiver,
    rtde_connector,
    tool_from_tcp,
)

from .twist_topic import vectors

PARAMETERS = (
    Parameter("robot_ip", "", "Address of the robot's controller; must be given"),
    Parameter("rate", 125.0, "Samples per second", "Hz", minimum=1.0, maximum=500.0),
    Parameter("tf_prefix", "", "Put before the names of frames and joints; for several arms"),
    Parameter(
        "tcp_offset",
        [0.0] * 6,
        "Tool centre point set on the teach pendant, [x y z rx ry rz] with a rotation vector",
        "m, rad",
    ),
    Parameter("timeout", 0.5, "Connect again after this long without a sample", "s", minimum=0.05, maximum=60.0),
    Parameter("reconnect_period", 2.0, "Pause between attempts to connect", "s", minimum=0.1, maximum=600.0),
)

_CLOCK_STEP_NS = 1_000_000_000
_SILENT_S = 1.0


class UrTf(PipelineNode):
    """Node that publishes TF `base` -> `tool0`, static TF `base_link` -> `base`, `joint_states`, and `wrench`, on the
    tool centre point and along the axes of `base`.

    `connect(robot_ip, rate)` opens a receiver or raises ConnectionError. A thread of its own reads it, so
    that an arm that does not answer blocks neither the diagnostics nor the shutdown.
    """

    def __init__(self, connect: Callable[[str, float], RtdeReceiver], **kwargs):
        super().__init__("ur_tf", **kwargs)
        self._settings = Parameters(self, PARAMETERS)
        if self.get_parameter("use_sim_time").value:
            raise InputError("ur_tf reads a real arm, whose time is wall time: set use_sim_time to false")
        if not self._settings["robot_ip"]:
            raise InputError("ur_tf: parameter 'robot_ip' is empty; give the address of the arm's controller")
        self._connect = connect
        prefix = self._settings["tf_prefix"]
        self._base, self._tool = prefix + "base", prefix + "tool0"
        self._joints = [prefix + name for name in JOINT_NAMES]
        self._tf = self.create_publisher(TFMessage, "/tf", qos.TF)
        self._joint_states = self.create_publisher(JointState, "joint_states", qos.stream_publisher())
        self._wrench = self.create_publisher(WrenchStamped, "wrench", qos.stream_publisher())
        static = self.create_publisher(TFMessage, "/tf_static", qos.latched())
        now = self.get_clock().now().to_msg()
        base = stamped_transform(now, prefix + "base_link", self._base, BASE_LINK_FROM_BASE)
        static.publish(TFMessage(transforms=[base]))

        self._trouble = "not connected yet"
        self._samples, self._connections, self._newest_stamp = 0, 0, 0
        self._heard = -math.inf  # when the last sample was published, on the monotonic clock
        self._diagnostics = Diagnostics(self, self._describe, hardware_id=self._settings["robot_ip"])
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rtde", daemon=True)
        self._thread.start()

    def destroy_node(self) -> None:
        """Stop reading, then destroy the node."""
        self._stop.set()
        self._thread.join(timeout=5.0)
        super().destroy_node()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                arm = self._connect(self._settings["robot_ip"], self._settings["rate"])
            except Exception as error:  # mostly ConnectionError; after any error the next attempt may work
                self._report(str(error))
            else:
                self._connections += 1
                self.get_logger().info(f"connected to {self._settings['robot_ip']}")
                # ur-rtde raises errors of any type, rclpy if its context is shut down in mid-call: the thread continues
                try:
                    self._follow(arm)
                except Exception as error:
                    if not self.context.ok():
                        return
                    self._report(f"connection lost: {error}")
                finally:
                    self._close(arm)
            self._stop.wait(self._settings["reconnect_period"])

    def _close(self, arm: RtdeReceiver) -> None:
        try:
            arm.close()
        except Exception as error:
            self.get_logger().warning(f"the lost connection does not close: {error}")

    def _follow(self, arm: RtdeReceiver) -> None:
        """Publish every new state until the connection ends or the node is stopped."""
        # The robot's clock is tracked on the monotonic one, so that a step of the wall clock shows in stamps at once.
        clock, wall = RobotClock(), ClockOffset()
        newest, since = None, time.monotonic()
        period, timeout = 1.0 / self._settings["rate"], self._settings["timeout"]
        while not self._stop.is_set():
            state = arm.read()
            arrival = time.monotonic_ns()
            if state is None:
                self._report("connection lost")
                return
            if state.robot_time != newest:
                newest, since = state.robot_time, time.monotonic()
                wall.update()
                stamp = wall.to_wall_ns(clock.stamp(state.robot_time, arrival))
                # The first samples of a connection may be stamped late, until the delay is known. Later samples with
                # earlier stamps would move the arm back in time; if far earlier, our own clock was set back.
                if not 0 <= self._newest_stamp - stamp < _CLOCK_STEP_NS:
                    self._newest_stamp = stamp
                    self._publish(state, stamp)
            elif time.monotonic() - since > timeout:
                self._report(f"no new sample for {timeout:g} s")
                return
            self._stop.wait(period)

    def _publish(self, state: ArmState, stamp_ns: int) -> None:
        try:
            tool = tool_from_tcp(state.tcp_pose, self._settings["tcp_offset"])
        except InputError as error:
            self._diagnostics.problem("bad_samples", str(error))
            return
        stamp = stamp_from_ns(stamp_ns)
        self._tf.publish(TFMessage(transforms=[stamped_transform(stamp, self._base, self._tool, tool)]))
        self._joint_states.publish(
            JointState(
                header=Header(stamp=stamp, frame_id=self._base),
                name=self._joints,
                position=state.positions.tolist(),
                velocity=state.velocities.tolist(),
            )
        )
        force, torque = vectors(state.wrench)
        header = Header(stamp=stamp, frame_id=self._base)
        self._wrench.publish(WrenchStamped(header=header, wrench=Wrench(force=force, torque=torque)))
        self._samples += 1
        self._trouble, self._heard = "", time.monotonic()

    def _report(self, trouble: str) -> None:
        self._trouble = trouble
        self.get_logger().warning(f"{self._settings['robot_ip']}: {trouble}", throttle_duration_sec=10.0)

    def _describe(self) -> tuple[bytes, str, dict]:
        values = {"samples": self._samples, "connections": self._connections}
        silent = time.monotonic() - self._heard
        trouble = self._trouble
        if not trouble and silent > self._settings["timeout"] + _SILENT_S:  # a call that hangs reports nothing
            trouble = f"no sample for {silent:.0f} s"
        return (ERROR, trouble, values) if trouble else (OK, "connected", values)


def main() -> int:
    """Entry point of the executable."""
    return run(lambda: [UrTf(rtde_connector())])


if __name__ == "__main__":
    sys.exit(main())
