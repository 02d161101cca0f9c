"""Slide a simulated finger over an object: an engine of plain TF for `digit_sim`.

midastouch build-codebook handle_tool
midastouch run digit_sim object:=handle_tool       # this and the next in terminals of their own
midastouch run localization object:=handle_tool
python examples/simulated_finger.py
"""

import sys
import time

import numpy as np
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from rclpy.node import Node
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_msgs.msg import FilterStatus
from midastouch_perception import ObjectMesh, SensorModel, bundled_objects, se3
from midastouch_perception.message_arrays import pose_from_msg, stamp_ns
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import stamp_from_ns, transform_to_msg
from midastouch_perception.simulation.slide import simulate_slide

RATE, SPEED, STEP = 100, 0.03, 1.5e-3  # Hz; m/s; m between two poses of the path
LIFTED = 5e-3  # m
PATIENCE = 200_000_000  # ns
BASE_FROM_OBJECT = se3.make(np.eye(3), np.array([0.4, 0.0, 0.1]))


class Finger(Node):
    """Hovers until the filter sees it do so, then slides along `path`, poses T_obj_gel (N, 4, 4), and is `done`.

    An engine's time is its own: this one waits for the filter, however slow the computer is.
    """

    def __init__(self, path: np.ndarray):
        super().__init__("simulated_finger")
        self.path, self.began, self.done, self.state = path, None, False, "no filter_status yet"
        self.now = self.answered = time.time_ns()
        self.tf = self.create_publisher(TFMessage, "/tf", qos.TF)
        self.create_subscription(FilterStatus, "filter_status", self.on_status, qos.latched())
        self.create_subscription(PoseWithCovarianceStamped, "pose", self.on_pose, qos.latched())
        self.create_timer(1 / RATE, self.move)
        self.error = np.nan

    def place(self, stamp: int) -> np.ndarray:
        """Where the gel is on the object at a time [ns]."""
        along = 0.0 if self.began is None else 1e-9 * (stamp - self.began) * SPEED / STEP
        i = int(np.clip(along, 0, len(self.path) - 2))
        rest = np.clip(along - i, 0, 1)
        pose = self.path[i] @ se3.exp(rest * se3.log(se3.inverse(self.path[i]) @ self.path[i + 1]))
        pose[:3, 3] += LIFTED * max(0.0, 1 - along * STEP / LIFTED) * pose[:3, 2]  # it comes down in the first 5 mm
        self.done = along > len(self.path)
        return pose

    def move(self) -> None:
        """Say on TF where object and gel are."""
        if self.began is None or self.now - self.answered < PATIENCE:
            self.now += 1_000_000_000 // RATE
        header = Header(stamp=stamp_from_ns(self.now), frame_id="base_link")
        frames = {"object_ground_truth": BASE_FROM_OBJECT, "digit_gel_frame": BASE_FROM_OBJECT @ self.place(self.now)}
        self.tf.publish(
            TFMessage(
                transforms=[
                    TransformStamped(header=header, child_frame_id=name, transform=transform_to_msg(pose))
                    for name, pose in frames.items()
                ]
            )
        )

    def on_status(self, status: FilterStatus) -> None:
        """Begin once the filter works."""
        if status.state == FilterStatus.STATE_NO_CONTACT and self.began is None:
            self.began = self.now
        if status.state != FilterStatus.STATE_WAITING:
            self.state, self.answered = status.state, stamp_ns(status.header.stamp)

    def on_pose(self, pose: PoseWithCovarianceStamped) -> None:
        """Compare with the truth, which an engine knows."""
        truth = self.place(stamp_ns(pose.header.stamp))
        self.error = np.linalg.norm(pose_from_msg(pose.pose.pose)[:3, 3] - truth[:3, 3])


def main(length: float, name: str) -> None:
    """Print the state and the error of the published pose every second."""
    mesh = ObjectMesh.load(bundled_objects()[name])
    path = simulate_slide(mesh, SensorModel.load("digit_tacto"), length, np.random.default_rng(3), STEP)
    rclpy.init()
    finger = Finger(path)
    finger.create_timer(1.0, lambda: print(f"{finger.state:20s} {1e3 * finger.error:6.1f} mm", flush=True))
    while not finger.done:
        rclpy.spin_once(finger)


if __name__ == "__main__":
    defaults = ["0.3", "handle_tool"]
    arguments = [*sys.argv[1:], *defaults[len(sys.argv) - 1 :]]
    main(float(arguments[0]), arguments[1])
