"""Node `mount_tf`: static TF of the sensor on the tool, for use without robot_state_publisher."""

from __future__ import annotations

import sys
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from tf2_msgs.msg import TFMessage

from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamped_transform
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_common.ros.spin import run

from ..mount import read_mount

PARAMETERS = (
    Parameter("frames_file", "", "Hand-eye calibration and mount; empty: the frames.yaml of midastouch_bringup"),
    Parameter("tool_frame", "", "Frame the sensor is mounted on; empty: as in frames_file"),
    Parameter("tf_prefix", "", "Put before the tool's frame, as in the UR driver"),
    Parameter("sensor_prefix", "", "Put before the sensor's frames; for several sensors"),
)


class MountTf(PipelineNode):
    """Node that publishes the transforms of a frames file, once, latched."""

    def __init__(self, **kwargs):
        super().__init__("mount_tf", **kwargs)
        settings = Parameters(self, PARAMETERS)
        folder = Path(get_package_share_directory("midastouch_bringup"))
        mount = read_mount(
            settings["frames_file"] or folder / "config" / "frames.yaml",
            settings["sensor_prefix"],
            settings["tool_frame"],
            settings["tf_prefix"],
        )
        now = self.get_clock().now().to_msg()
        self.create_publisher(TFMessage, "/tf_static", qos.latched()).publish(
            TFMessage(transforms=[stamped_transform(now, *each) for each in mount])
        )
        self.get_logger().info(", ".join(f"{parent} -> {child}" for parent, child, _ in mount))


def main() -> int:
    """Entry point of the executable."""
    return run(lambda: [MountTf()])


if __name__ == "__main__":
    sys.exit(main())
