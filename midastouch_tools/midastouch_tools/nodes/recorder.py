"""Node `recorder`: writes topics into an MCAP bag, for machines whose ROS comes without rosbag2."""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from rclpy.clock import Clock, ClockType
from rclpy.subscription import Subscription

from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_common.ros.diagnostics import ERROR, OK, Diagnostics
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_common.ros.spin import run

from ..bags.messages import SEQUENCE_TOPICS, Message, Topic
from ..bags.writer import BagWriter
from ..text_table import counted
from .message_types import live_name, message_class

TOPICS = (
    *SEQUENCE_TOPICS,
    Topic("/joint_states", "sensor_msgs/msg/JointState"),
    Topic("/initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    Topic("/tactile/contact", "midastouch_msgs/msg/TactileContact"),
    Topic("/tactile/code", "midastouch_msgs/msg/TactileCode"),
    Topic("/filter_status", "midastouch_msgs/msg/FilterStatus", latched=True),
    Topic("/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", latched=True),
    Topic("/pose_modes", "midastouch_msgs/msg/PoseModes"),
    Topic("/particles", "geometry_msgs/msg/PoseArray"),
    Topic("/delta_twist_cmds", "geometry_msgs/msg/TwistStamped"),
    Topic("/contact_controller/enable", "std_msgs/msg/Bool"),
    Topic("/wrench", "geometry_msgs/msg/WrenchStamped"),
    Topic("/explorer/status", "midastouch_msgs/msg/ExplorerStatus", latched=True),
    Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
)
"""Inputs and results of the pipeline, commands to an arm, and the health of the nodes."""

PARAMETERS = (
    Parameter(
        "path",
        "",
        "Bag to write: an .mcap file, or a folder for any other name; in its last part %Y, %m, %d, %H, %M and %S stand "
        "for the date and time of the start",
    ),
    Parameter(
        "min_free",
        200.0,
        "Recording ends, and its bag is completed, when the disk has less room than this",
        "MiB",
        minimum=0.0,
        maximum=1e6,
    ),
)

_DEPTH = 1000
_MIB = 2**20
MOST_EARLY = 64 * _MIB  # bytes kept of messages from before the clock starts


class Recorder(PipelineNode):
    """Node that records `topics` into the bag named by the parameter `path`, which appears when the node is destroyed.

    Topics are resolved in the node's namespace, and have their full names in the bag. Messages are stamped with the
    node's clock: with `use_sim_time` that is the time of a replay. Messages that come before the clock starts are
    stamped with its start: all latched ones, and others as long as they fit into `MOST_EARLY`. `metadata` are texts
    kept in the bag, and may be changed until its end. Raises InputError if the path is taken or a message type is not
    installed.

    Once the disk is nearly full, the bag is completed as it is; `failure` then gives the reason for its end. `path` is
    that of the bag, with the date filled in.
    """

    def __init__(self, topics: Sequence[Topic] = TOPICS, metadata: dict[str, str] | None = None, **kwargs) -> None:
        super().__init__("recorder", **kwargs)
        parameters = Parameters(self, PARAMETERS)
        self.path, self._min_free = _dated(parameters["path"]), parameters["min_free"] * _MIB
        self.failure = ""
        kinds = [message_class(topic.type_name) for topic in topics]
        topics = [dataclasses.replace(t, name=self.resolve_topic_name(live_name(t.name))) for t in topics]
        self.counts = dict.fromkeys((topic.name for topic in topics), 0)
        self._early: list[tuple[Topic, bytes]] = []
        self._early_size = 0
        self._open = contextlib.ExitStack()
        self._bag = self._open.enter_context(BagWriter(self.path, metadata))
        self.metadata = self._bag.metadata
        self._heard = [self._subscribe(topic, kind) for topic, kind in zip(topics, kinds, strict=True)]
        self.create_timer(0.5, self._watch_disk, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._diagnostics = Diagnostics(self, self._describe)

    def unheard(self, topics: Iterable[str]) -> list[str]:
        """Return those of the topics, absolute, without a connected publisher: messages on them would be lost."""
        connected = {each.topic_name for each in self._heard if each.get_publisher_count() > 0}
        return [topic for topic in topics if self.resolve_topic_name(live_name(topic)) not in connected]

    def destroy_node(self) -> None:
        """Complete the bag, then destroy the node."""
        self._complete()
        super().destroy_node()

    def _subscribe(self, topic: Topic, kind: type) -> Subscription:
        profile = qos.latched(_DEPTH) if topic.latched else qos.stream_subscriber(_DEPTH, reliable=True)
        return self.create_subscription(kind, topic.name, lambda data: self._on_message(topic, data), profile, raw=True)

    def _watch_disk(self) -> None:
        if self.failure:
            return
        folder = Path(self.path).expanduser().resolve().parent
        try:
            free = shutil.disk_usage(folder).free
        except OSError as error:  # the folder is gone
            why = f"{folder}: {error.strerror}"
        else:
            if free >= self._min_free:
                return
            why = f"{folder} has {free / _MIB:.0f} MiB left"
        self._complete()
        if not self.failure:
            self._give_up(f"{why}; recording ended, {self.path} is complete")

    def _complete(self) -> None:
        """Give the bag its name; a second call does nothing."""
        try:
            with self._open:
                self._write_early(0)
        except OSError as error:
            self._give_up(f"{error.filename or self.path}: {error.strerror or error}; the recording is lost")

    def _give_up(self, reason: str) -> None:
        self.failure = self.failure or reason
        self.get_logger().error(reason)

    def _describe(self) -> tuple[bytes, str, dict]:
        return (ERROR, self.failure, self.counts) if self.failure else (OK, f"recording {self.path}", self.counts)

    def _on_message(self, topic: Topic, data: bytes) -> None:
        if self.failure:
            return
        now = self.get_clock().now().nanoseconds
        if now == 0:
            self._keep_early(topic, data)
            return
        self.counts[topic.name] += 1
        self._write_early(now)
        self._write(topic, data, now)

    def _keep_early(self, topic: Topic, data: bytes) -> None:
        if self._early_size + len(data) > MOST_EARLY and not topic.latched:
            self._diagnostics.problem(
                "before_clock",
                "nothing publishes /clock, messages are lost: start the replay, or set use_sim_time to false",
            )
            return
        self.counts[topic.name] += 1
        self._early_size += len(data)
        self._early.append((topic, data))

    def _write_early(self, now: int) -> None:
        early, self._early = self._early, []
        for topic, data in early:
            self._write(topic, data, now)

    def _write(self, topic: Topic, data: bytes, now: int) -> None:
        if self.failure:
            return
        try:
            self._bag.write(Message(topic.name, topic.type_name, now, data, topic.latched))
        except OSError as error:
            self._open.__exit__(type(error), error, error.__traceback__)
            self._give_up(f"{error.filename or self.path}: {error.strerror or error}; the recording is lost")


def _dated(path: str) -> str:
    """Return the path with date and time filled into its last part. InputError if it is empty."""
    if not path:
        raise InputError("recorder: parameter 'path' is empty; name the bag to write")
    return str(Path(path).with_name(time.strftime(Path(path).name)))


def main(args: list[str] | None = None) -> int:
    """Entry point of the executable; exit code 1: the recording is incomplete or lost."""
    nodes: list[Recorder] = []

    def make() -> list[Recorder]:
        nodes.append(recorder := Recorder())
        recorder.get_logger().info(f"recording {recorder.path} until Ctrl-C")
        return nodes

    status = run(make, args)
    if not nodes or nodes[0].failure:
        return status or len(nodes)
    counts = nodes[0].counts
    images = sum(count for topic, count in counts.items() if "/image_raw" in topic)
    print(f"{nodes[0].path}: {counted(sum(counts.values()), 'message')}, {counted(images, 'image')} among them")
    return status


if __name__ == "__main__":
    sys.exit(main())
