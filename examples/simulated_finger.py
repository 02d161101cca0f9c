"""Slide a simulated finger over an object: an engine of plain TF for `digit_sim`.

midastouch build-codebook handle_tool
midastouch run digit_sim object:=handle_tool       # this and the next in terminals of their own
midastouch run localization object:=handle_tool
python examples/simulated_finger.py
"""

import sys
import time
from collections import deque
from collections.abc import Callable

import numpy as np
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common import se3
from midastouch_common.message_arrays import pose_from_msg, stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import pose_to_msg, stamp_from_ns, transform_to_msg
from midastouch_msgs.msg import FilterStatus
from midastouch_perception import ObjectMesh, SensorModel, bundled_objects
from midastouch_simulation.slide import simulate_slide
from midastouch_tools.processes.foreground import ended_by_signals

BASE_FROM_OBJECT = se3.translation([0.5, 0.0, 0.2])
SECOND = 1_000_000_000  # ns
TICK, TIMEOUT = SECOND // 100, SECOND // 5
START_S = 10.0  # s, until nodes that run are known
FREE = 40  # images
KNOWN = 5e-3  # m, error of a filter that has taken the start
SPEED, STEP, LIFTED = 0.03, 1.5e-3, 5e-3  # m/s; m between two poses of a path; m above its start


class Engine(Node):
    """Node that publishes the poses of gel and object on TF, and prints how well the filter knows the gel's pose.

    motion: returns the gel's pose T_obj_gel (4, 4) at a number of seconds after the start, for ascending times; it
    lasts `seconds`. It starts once `tdn` has its no-contact image, the median of its first 32 images; with
    `start_given` the node sends the filter the pose, to a few millimetres, until it has it. An engine's time is its
    own: this one waits for a slow filter.
    """

    def __init__(self, motion: Callable[[float], np.ndarray], seconds: float, start_given: bool):
        super().__init__("engine")
        self.motion, self.seconds, self.start_given = motion, seconds, start_given
        self.now = self.answered = time.time_ns()
        self.began, self.done, self.state, self.error = None, False, "no filter_status yet", np.nan
        self.free = 0  # images that show no contact
        self.past = deque(maxlen=1000)  # time [ns] and pose
        self.tf = self.create_publisher(TFMessage, "/tf", qos.TF)
        self.start = self.create_publisher(PoseWithCovarianceStamped, "initialpose", qos.COMMAND)
        self.create_subscription(FilterStatus, "filter_status", self.on_status, qos.latched())
        self.create_subscription(PoseWithCovarianceStamped, "pose", self.on_pose, qos.latched())
        self.create_timer(1e-9 * TICK, self.move)
        self.create_timer(1.0, self.tell)

    def move(self) -> None:
        """Advance by one tick, unless the filter is behind."""
        if self.began is None or self.now - self.answered < TIMEOUT:
            self.now += TICK
            elapsed = 0.0 if self.began is None else (self.now - self.began) / SECOND
            self.past.append((self.now, self.motion(elapsed)))
            self.done = elapsed > self.seconds
        header = Header(stamp=stamp_from_ns(self.now), frame_id="base_link")
        frames = {"object_ground_truth": BASE_FROM_OBJECT, "digit_gel_frame": BASE_FROM_OBJECT @ self.past[-1][1]}
        transforms = [
            TransformStamped(header=header, child_frame_id=name, transform=transform_to_msg(pose))
            for name, pose in frames.items()
        ]
        self.tf.publish(TFMessage(transforms=transforms))

    def on_status(self, status: FilterStatus) -> None:
        """Begin once the filter works."""
        self.free += status.state == FilterStatus.STATE_NO_CONTACT
        if self.free > FREE and self.began is None:
            if self.start_given and not self.error < KNOWN:
                self.start.publish(start_at(self.past[-1][1]))  # again, as a node that was just found may miss it
            else:
                self.began = self.now
        if status.state != FilterStatus.STATE_WAITING:
            self.state, self.answered = status.state, stamp_ns(status.header.stamp)

    def on_pose(self, pose: PoseWithCovarianceStamped) -> None:
        """Compare with the truth, which an engine knows."""
        stamp = stamp_ns(pose.header.stamp)
        _, truth = min(self.past, key=lambda entry: abs(entry[0] - stamp))
        self.error = np.linalg.norm(pose_from_msg(pose.pose.pose)[:3, 3] - truth[:3, 3])

    def tell(self) -> None:
        """Print the state and the error of the published pose."""
        print(f"{self.state:20s} {1e3 * self.error:6.1f} mm", flush=True)


def start_at(T_obj_gel: np.ndarray) -> PoseWithCovarianceStamped:
    """Return a start for the filter, known to 3 mm and 3 deg."""
    message = PoseWithCovarianceStamped(header=Header(frame_id="object"))
    message.pose.pose = pose_to_msg(T_obj_gel)
    message.pose.covariance = np.diag(np.repeat([0.003, np.radians(3)], 3) ** 2).ravel()
    return message


def run(motion: Callable[[float], np.ndarray], seconds: float, start_given: bool = False) -> None:
    """Move the finger until the motion is over; end with the program's manual if sensor or filter do not run."""
    if sys.argv[1:]:
        sys.exit(sys.modules["__main__"].__doc__)  # it takes no arguments
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    engine = Engine(motion, seconds, start_given)
    begin = time.monotonic()
    while missing := [topic for topic in ("image_raw", "filter_status") if engine.count_publishers(topic) == 0]:
        if time.monotonic() - begin > START_S:
            sys.exit(f"nothing publishes {' and '.join(missing)}; start first:\n{sys.modules['__main__'].__doc__}")
        rclpy.spin_once(engine)
    while not engine.done:
        rclpy.spin_once(engine)
    engine.tell()


def along(path: np.ndarray, lifted: float = LIFTED) -> Callable[[float], np.ndarray]:
    """Return a motion along poses T_obj_gel (N, 4, 4), onto the first from `lifted` m above."""

    def motion(seconds: float) -> np.ndarray:
        gone = seconds * SPEED
        i = int(np.clip(gone / STEP, 0, len(path) - 2))
        rest = np.clip(gone / STEP - i, 0, 1)
        pose = path[i] @ se3.exp(rest * se3.log(se3.inverse(path[i]) @ path[i + 1]))
        pose[:3, 3] += max(0.0, lifted - gone) * pose[:3, 2]
        return pose

    return motion


if __name__ == "__main__":
    with ended_by_signals():
        mesh = ObjectMesh.load(bundled_objects()["handle_tool"])
        slide = simulate_slide(mesh, SensorModel.load("digit_tacto"), 0.3, np.random.default_rng(9), STEP)
        run(along(slide), len(slide) * STEP / SPEED)
