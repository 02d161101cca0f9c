"""Node `twist_arm`: an arm without joints that follows twists, on TF; to try `slider` where there is no arm."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TransformStamped, TwistStamped
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.ros import qos, spin
from midastouch_common.ros.conversions import transform_to_msg
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_filter.transforms import SECOND

from ..simulated_arm import SimulatedArm
from .twist_topic import finite_twist

PARAMETERS = (
    Parameter("base_frame_id", "base_link", "Frame of the arm's base"),
    Parameter("sensor_frame_id", "digit_gel_frame", "Gel frame, which follows the twists"),
    Parameter("start", [0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0], "Pose of the gel at first: x y z [m], quaternion x y z w"),
    Parameter("rate", 125.0, "Transforms per second", unit="Hz", minimum=10.0, maximum=1000.0),
    Parameter("latency", 0.05, "From a twist to the motion", unit="s", minimum=0.0, maximum=0.5),
    Parameter("timeout", 0.1, "Without a twist for so long it stops", unit="s", minimum=0.01, maximum=10.0),
)


class TwistArm(PipelineNode):
    """Moves the gel frame by the twists on `delta_twist_cmds`, which are in that frame."""

    def __init__(self, **node_options):
        super().__init__("twist_arm", **node_options)
        self._settings = p = Parameters(self, PARAMETERS)
        start = se3.from_xyzquat(np.array(p["start"]))
        self._arm = SimulatedArm(start, p["latency"], p["timeout"])
        self._tf = self.create_publisher(TFMessage, "/tf", qos.TF)
        self.create_subscription(TwistStamped, "delta_twist_cmds", self._on_twist, qos.stream_subscriber(10))
        self.create_timer(1.0 / p["rate"], self._on_timer)

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds / SECOND

    def _on_twist(self, msg: TwistStamped) -> None:
        try:
            self._arm.command(self._now(), finite_twist(msg, self._settings["sensor_frame_id"]))
        except InputError as error:
            self.get_logger().warning(str(error))

    def _on_timer(self) -> None:
        now = self.get_clock().now()
        transform = transform_to_msg(self._arm.advance(now.nanoseconds / SECOND))
        header = Header(stamp=now.to_msg(), frame_id=self._settings["base_frame_id"])
        child = self._settings["sensor_frame_id"]
        self._tf.publish(
            TFMessage(transforms=[TransformStamped(header=header, child_frame_id=child, transform=transform)])
        )


def main(args=None) -> int:
    """Entry point of the executable `twist_arm`."""
    return spin.run(lambda: [TwistArm()], args)


if __name__ == "__main__":
    raise SystemExit(main())
