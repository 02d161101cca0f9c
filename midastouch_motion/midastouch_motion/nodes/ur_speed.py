"""Node `ur_speed`: a UR arm without its ROS driver follows twists of the gel, by `speedL` of ur-rtde."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import TwistStamped

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.managed_node import AUTOSTART, ManagedNode
from midastouch_common.ros.parameters import Parameter
from midastouch_common.ros.transform_source import TransformSource

from ..ur import ur_follower
from ..ur.follower_process import FollowerProcess
from ..ur.rtde import require_ur_rtde, transform_from_rtde
from ..ur.tcp_twist import TwistLimits, twist_of_tcp
from ..ur.ur_control import Stopping
from .twist_topic import twist_of

PARAMETERS = (
    Parameter("robot_ip", "", "Address of the robot's controller; must be given"),
    Parameter("sensor_frame_id", "digit_gel_frame", "Gel frame, in which the twists are"),
    Parameter("tool_frame_id", "tool0", "The arm's flange, on TF"),
    Parameter(
        "tcp_offset",
        [0.0] * 6,
        "Tool centre point set on the teach pendant, [x y z rx ry rz] with a rotation vector",
        "m, rad",
    ),
    Parameter("max_speed", 0.1, "Faster twists are refused", unit="m/s", minimum=1e-3, maximum=1.0),
    Parameter("max_turn_speed", 1.0, "Faster twists are refused", unit="rad/s", minimum=0.01, maximum=3.0),
    Parameter("acceleration", 0.5, "Of the TCP, between two twists", unit="m/s^2", minimum=0.05, maximum=10.0),
    Parameter("deceleration", 5.0, "Of the TCP, for a stop", unit="m/s^2", minimum=1.0, maximum=50.0),
    Parameter("timeout", 0.1, "The arm stops after this time without a twist", unit="s", minimum=0.02, maximum=10.0),
    Parameter("reconnect_period", 2.0, "Pause between attempts to connect", unit="s", minimum=0.1, maximum=600.0),
    AUTOSTART,
)


class UrSpeed(ManagedNode):
    """Node that, while active, keeps a connection to the arm and makes it follow `delta_twist_cmds`.

    make_follower(command, pause, on_change): as `FollowerProcess`.
    """

    def __init__(self, make_follower: Callable[..., FollowerProcess] = FollowerProcess, **node_options):
        super().__init__("ur_speed", PARAMETERS, **node_options)
        self._make_follower = make_follower
        self._follower: FollowerProcess | None = None
        self._transforms: TransformSource | None = None
        self._carried_out = 0
        self.autostart()

    def configure(self) -> None:
        """Check everything that can be checked without the arm."""
        p = self.parameters
        if self.get_parameter("use_sim_time").value:
            raise InputError("ur_speed moves a real arm, whose time is wall time: set use_sim_time to false")
        if not p["robot_ip"]:
            raise InputError("ur_speed: parameter 'robot_ip' is empty; give the address of the arm's controller")
        self._limits = TwistLimits(p["sensor_frame_id"], p["max_speed"], p["max_turn_speed"])
        self._frames = p["tool_frame_id"], p["sensor_frame_id"]
        self._tcp_from_tool = se3.inverse(transform_from_rtde(p["tcp_offset"]))

    def unload(self) -> None:
        """Do nothing: nothing is loaded."""

    def connect(self) -> None:
        """Listen to twists and TF, and connect to the arm as soon as it answers."""
        p = self.parameters
        self.diagnostics.hardware_id = p["robot_ip"]
        self.create_subscription(TwistStamped, "delta_twist_cmds", self._on_twist, qos.stream_subscriber(1))
        # last: nothing would end their threads if something after them failed
        self._transforms = TransformSource(
            self, frames=self._frames, on_bad=lambda reason: self.diagnostics.problem("bad_transforms", reason)
        )
        stopping = Stopping(p["acceleration"], p["deceleration"], p["timeout"])
        command = ur_follower.command(p["robot_ip"], stopping)
        self._follower = self._make_follower(command, p["reconnect_period"], self._on_change)

    def disconnect(self) -> None:
        """Stop the arm."""
        if self._follower is not None:
            self._follower.close()
            self._follower = None
        if self._transforms is not None:
            self._transforms.close()
            self._transforms = None

    def describe(self) -> tuple[bytes, str, dict]:
        """Return level, message and values for the diagnostics."""
        values = {"twists": self._carried_out, "connections": self._follower.connections}
        if trouble := self._follower.trouble:
            return diagnostics.ERROR, trouble, values
        if self._follower.broken_off:
            return diagnostics.WARN, "the motion was broken off; the arm follows once twists have paused", values
        return diagnostics.OK, "connected", values

    def _on_change(self, trouble: str) -> None:
        robot_ip = self.diagnostics.hardware_id
        if trouble:
            self.get_logger().warning(f"{robot_ip}: {trouble}")
        else:
            self.get_logger().info(f"connected to {robot_ip}")

    def _on_twist(self, msg: TwistStamped) -> None:
        if self._follower is None:  # deactivated in the same round of the executor
            return
        twist = twist_of(msg)
        tool_from_gel = self._transforms.known(*self._frames, self.get_clock().now().nanoseconds)
        if refusal := self._limits.refusal(msg.header.frame_id, twist):
            self._refuse("refused_twists", refusal)
        elif tool_from_gel is None:
            self._refuse("twists_before_tf", f"TF has no pose of {self._frames[1]} on {self._frames[0]}")
        else:
            self._carried_out += 1
            self._follower.send(twist_of_tcp(twist, self._tcp_from_tool @ tool_from_gel))

    def _refuse(self, kind: str, reason: str) -> None:
        self.diagnostics.problem(kind, f"the arm stops: {reason}")
        self._follower.send(np.zeros(6))


def _make_nodes() -> list[UrSpeed]:
    require_ur_rtde()
    return [UrSpeed()]


def main(args=None) -> int:
    """Entry point of the executable `ur_speed`."""
    return spin.run(_make_nodes, args)


if __name__ == "__main__":
    raise SystemExit(main())
