"""Age of an image when the filter finds the sensor's transform at its stamp, while a fast arm publishes.

Run as a module, this file is that arm and a camera: `python -m midastouch_benchmark.ros.pose_age`.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.queue import Wait
from midastouch_common.transforms.rigid import TransformError
from midastouch_tools.processes.local_domain import local_environment, own_domain
from midastouch_tools.ros.local_context import local_context

from ..speed.timing import time_calls

TRANSFORMS_HZ, IMAGES_HZ = 500, 30
_STEPPING = 1 / 3  # of the time: reading the transforms takes a third of a fast core, and more of a slow one
_TIMED_STEPS = 20
# An arm with the gel on its last link, and a hand: 20 links in one message, as a robot_state_publisher sends them.
_ARM = ["base_link", *(f"arm_{i}" for i in range(1, 8)), "digit_gel_frame"]
_HAND = ["arm_7", *(f"hand_{i}" for i in range(1, 13))]
_SETTLED = 10  # images, until all are connected
_TIMEOUT_S = 60.0


def pose_age(step: Callable[[], object], images: int = 150) -> dict:
    """Measure pose_age_ms, the time from an image's stamp until its transform is found, at pose_age_hz images a second.

    Another process sends 500 Hz of transforms of 20 links, and `step` is called after each image; `followed_rate` sets
    the rate of the images. Raises InputError if too few images find their transform in time.
    """
    domain = own_domain()
    rate = followed_rate(1e-3 * float(np.mean(time_calls(step, _TIMED_STEPS).wall_ms)))
    seconds = (images + _SETTLED) / rate + _TIMEOUT_S
    robot = subprocess.Popen([sys.executable, "-m", __name__, str(seconds), str(rate)], env=local_environment(domain))
    try:
        with local_context(domain) as context:
            ages = _listen(context, step, images + _SETTLED, seconds)
    finally:
        robot.kill()
        robot.wait()
    p50, p95, most = np.percentile(ages[_SETTLED:], [50, 95, 100]).round(4).tolist()
    return {"pose_age_ms": {"p50": p50, "p95": p95, "max": most}, "pose_age_hz": rate}


def followed_rate(step_s: float) -> float:
    """Return the images a second that a machine with steps of `step_s` [s] can follow; beyond that, images queue."""
    return min(float(IMAGES_HZ), _STEPPING / step_s)


def _listen(context: rclpy.Context, step: Callable[[], object], images: int, seconds: float) -> list[float]:
    """Return the age [ms] of each image."""
    node = Node("pose_age", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    ages: list[float] = []
    waiting: deque[int] = deque()

    def answer() -> None:
        while waiting:
            try:
                if isinstance(source.lookup(_ARM[0], _ARM[-1], waiting[0]), Wait):
                    return
                ages.append(1e-6 * (time.time_ns() - waiting.popleft()))
                step()
            except TransformError:  # an image from before the first transform
                waiting.popleft()

    def on_image(header: Header) -> None:
        waiting.append(stamp_ns(header.stamp))
        answer()

    source = TransformSource(node, (_ARM[0], _ARM[-1]), answer)
    node.create_subscription(Header, "images", on_image, qos.stream_subscriber(100, reliable=True))
    try:
        deadline = time.monotonic() + seconds
        while len(ages) < images:
            if time.monotonic() > deadline:
                raise InputError(f"{len(ages)} of {images} images found their transform: does DDS work?")
            executor.spin_once(timeout_sec=0.1)
    finally:
        source.close()
        executor.shutdown()
        node.destroy_node()
    return ages


def _send(seconds: float, images_hz: float) -> None:
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("arm")
    transforms = node.create_publisher(TFMessage, "/tf", qos.TF)
    images = node.create_publisher(Header, "images", qos.stream_publisher(100))
    message = TFMessage()
    for links in (_ARM, _HAND):
        for parent, child in pairwise(links):
            message.transforms.append(TransformStamped(header=Header(frame_id=parent), child_frame_id=child))
    begin = time.monotonic()
    count = sent = 0
    while (elapsed := time.monotonic() - begin) < seconds:
        stamp = stamp_from_ns(time.time_ns())
        for transform in message.transforms:
            transform.header.stamp = stamp
            transform.transform.translation.x = 0.1 * np.sin(elapsed)
        transforms.publish(message)
        if count * images_hz >= sent * TRANSFORMS_HZ:
            images.publish(Header(stamp=stamp_from_ns(time.time_ns())))
            sent += 1
        count += 1
        time.sleep(max(0.0, begin + count / TRANSFORMS_HZ - time.monotonic()))


if __name__ == "__main__":
    _send(*map(float, sys.argv[1:]))
