"""Node `replay`: plays a YCB-Slide sequence or a bag on the topics of a live sensor and arm."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock

from midastouch_msgs.msg import FilterStatus
from midastouch_perception.errors import InputError
from midastouch_perception.message_arrays import stamp_ns
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import stamp_from_ns
from midastouch_perception.ros.diagnostics import OK, PERIOD_S, WARN, Diagnostics
from midastouch_perception.ros.lifecycle_watch import LifecycleWatch
from midastouch_perception.ros.node import PipelineNode
from midastouch_perception.ros.parameters import Parameters
from midastouch_perception.ros.spin import run, stop

from ..flow_control import FlowControl
from ..keyboard import Keyboard
from ..messages import TF_TOPIC, Message, Topic, header_stamp_ns
from ..playback import Playback
from ..replay_source import ReplaySource, is_image
from .message_types import live_name, message_class
from .replay_control import KEYS_HELP, ReplayControl
from .replay_parameters import PARAMETERS

RCLError = rclpy_implementation.RCLError

_UNKNOWN = "_NODE_NAME_UNKNOWN_"  # the middleware's name for a node of which only the topics were heard of
_DEPTH = 100  # frames that a reliable subscriber (a recorder) may lag behind before it loses some
_MOST_AFTER_AN_IMAGE = 50  # messages while the filter is busy with it: a subscriber of TF keeps 100
_PASS_NS = 100_000_000  # how far time goes on at once after the end, where some frames may wait for their time-out


class Replay(PipelineNode):
    """Publishes images, camera info, TF and ground truth; `start()` begins, `finished` is set at the end.

    `on_end` is called from the playing thread when all was sent or the source failed, `error` then says why.
    """

    def __init__(self, on_end: Callable[[], None] = lambda: None, **kwargs) -> None:
        super().__init__("replay", **kwargs)
        self._settings = Parameters(self, PARAMETERS)
        if not self._settings["source"]:
            raise InputError("replay: parameter 'source' is empty; give a sequence folder or a bag")
        self._playback = Playback(self._settings["rate"], self._settings["start_paused"])
        self._on_end = on_end
        self.finished = threading.Event()
        self.error: Exception | None = None
        self.frames_sent = 0
        self.frames_repeated = 0  # of a stamp that was there before in this round: the recording holds them twice
        self._told = 0  # newest time on /clock, ns
        self._begin = (0.0, 0)  # of this round: s after the beginning, and the stamp that is, ns

        self._source = ReplaySource(self._settings["source"], self._settings["topics"].split())
        self._outputs = {topic.name: self._output(topic) for topic in self._source.topics}
        self._clock_output = self.create_publisher(Clock, "/clock", 10) if self._settings["clock"] else None
        self._statuses: Subscription | None = None
        if self._settings["ack_topic"]:
            profile = qos.latched(depth=50)
            self._statuses = self.create_subscription(
                FilterStatus, self._settings["ack_topic"], self._on_status, profile
            )
            self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        patience = max(1, round(self._settings["ack_timeout"] / PERIOD_S))
        self._flow = FlowControl(self._playback, patience, lambda: bool(self._filters()), self._on_lost)
        self._consumers = LifecycleWatch(self, self._settings["wait_for_nodes"].split())
        self.control = ReplayControl(self, self._playback, lambda: self.position, self._source.duration_s)
        Diagnostics(self, self._describe)
        self._thread = threading.Thread(target=self._play, name="replay", daemon=True)

    def start(self) -> None:
        """Begin to play, in a thread of its own; the node must be spun meanwhile."""
        self._thread.start()

    @property
    def frames_lost(self) -> int:
        """Frames that the filter never answered, nor said that they wait."""
        return self._flow.lost

    @property
    def position(self) -> float:
        """Seconds after the beginning of the recording that were told last."""
        offset, stamp = self._begin
        return offset + max(0, self._told - stamp) / 1e9

    def destroy_node(self) -> None:
        """Stop playing, then destroy the node."""
        self._playback.stop()
        if self._thread.is_alive():
            self._thread.join()
        super().destroy_node()

    def _play(self) -> None:
        try:
            self._wait_for_listeners()
            offset = self._settings["start_offset"]
            while not self._playback.stopped:
                self._playback.rewind()
                self._flow.forget()
                self._told, self._begin = 0, (offset, 0)
                self._play_once(offset)
                self._playback.wait_while_paused()  # at its end it can still be sent back
                self._flow.finish(lambda: self._tick(self._told + _PASS_NS))
                offset = self._playback.take_seek()
                if offset is None and not self._settings["loop"]:
                    break
                offset = self._settings["start_offset"] if offset is None else offset
            for publisher in self._outputs.values():
                publisher.wait_for_all_acked(Duration(seconds=2))
            self.get_logger().info(self._summary())
        except Exception as error:
            if isinstance(error, RCLError) and not self.context.ok():
                return  # the process was told to stop in the middle of a call
            self.error = error  # whatever it was: who waits for the end must not take it for a good one
            if not isinstance(error, InputError):
                raise
        finally:
            self.finished.set()
            self._on_end()

    def _play_once(self, offset: float) -> None:
        """Send what is recorded, each message once and in order; an image when the filter has the one before."""
        stamps: set[int] = set()
        after_image, stepping = 0, False
        try:
            for message in self._source.messages(round(offset * 1e9)):
                # What is latched may be of a time that is left out: neither pace nor clock begin there.
                if message.latched:
                    self._outputs[message.topic].publish(message.data)
                    continue
                image = is_image(message.topic)
                must_wait = image or after_image >= _MOST_AFTER_AN_IMAGE or self._playback.paused
                if must_wait and not self._flow.wait():
                    return
                # A step ends when its frame is answered, which may take transforms that were recorded after the image.
                if stepping and (image or not self._flow.waiting):
                    self._playback.frame_sent()
                    stepping = False
                if not self._playback.wait_until_due(message.stamp_ns, self._tick):
                    return
                if self._told == 0:
                    self._begin = (offset, message.stamp_ns)
                after_image += 1
                if image:
                    stamp = header_stamp_ns(message.data)
                    if self._statuses is not None:
                        self._flow.sent(stamp)
                    self.frames_repeated += stamp in stamps
                    stamps.add(stamp)
                    after_image, stepping = 0, True
                    self.frames_sent += 1
                self._send(message)
        finally:
            if stepping:
                self._playback.frame_sent()
        if self._told == 0 and offset == self._settings["start_offset"]:
            raise InputError(f"{self._settings['source']}: nothing to play from {offset:g} s on; it is shorter")

    def _send(self, message: Message) -> None:
        self._tick(message.stamp_ns)
        self._outputs[message.topic].publish(message.data)

    def _output(self, topic: Topic) -> Publisher:
        if topic.latched:
            profile = qos.latched(_DEPTH)
        else:
            profile = qos.TF if topic.name == TF_TOPIC else qos.stream_publisher(_DEPTH)
        return self.create_publisher(message_class(topic.type_name), live_name(topic.name), profile)

    def _wait_for_listeners(self) -> None:
        """Until all who are to hear the recording do: what is sent earlier would be lost to them."""
        while not self._playback.stopped:
            missing = self._missing()
            if not missing:
                return
            self.get_logger().info(f"waiting for {', '.join(missing)}", throttle_duration_sec=5.0)
            time.sleep(0.02)  # of Python: rclpy's raises when the process is told to stop meanwhile

    def _missing(self) -> list[str]:
        """What is still to come, in words: nodes to be active, listeners, and the filter's for TF."""
        images = [topic for topic in self._outputs if is_image(topic)]
        missing = [self._consumers.waiting_for] if self._consumers.waiting_for else []
        wanted = self._settings["wait_for_subscribers"] - sum(map(self._listeners, images))
        if wanted > 0:
            missing.append(f"{wanted} more subscribers of {' and '.join(images)}")
        if self._statuses is None:
            return missing
        filters = self._filters()
        if not filters or self._statuses.get_publisher_count() == 0:
            missing.append(f"a publisher of {self._settings['ack_topic']}")
        elif TF_TOPIC in self._outputs:
            listeners = self.get_subscriptions_info_by_topic(TF_TOPIC)
            if not filters & _names(listeners) or self._listeners(TF_TOPIC) < len(listeners):
                missing.append(f"{' or '.join(sorted(filters))} to subscribe {TF_TOPIC}")
        return missing

    def _listeners(self, topic: str) -> int:
        return self._outputs[topic].get_subscription_count()

    def _filters(self) -> set[str]:
        """Full names of the nodes that answer."""
        return _names(self.get_publishers_info_by_topic(self._statuses.topic_name))

    def _tick(self, recorded_ns: int) -> None:
        """Tell the recorded time; messages out of order do not turn it back."""
        if recorded_ns <= self._told:
            return
        self._told = recorded_ns
        if self._clock_output is not None:
            self._clock_output.publish(Clock(clock=stamp_from_ns(recorded_ns)))

    def _on_status(self, status: FilterStatus) -> None:
        self._flow.on_status(stamp_ns(status.header.stamp), status.state == FilterStatus.STATE_WAITING)

    def _on_diagnostics(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            # without its state it loads, or does not work at all
            at_work = any(item.key == "state" for item in status.values)
            if at_work and status.name.rpartition(": ")[2] in self._filters():
                self._flow.on_report()

    def _on_lost(self, stamp: int, why: str) -> None:
        self.get_logger().warning(
            f"no answer to the image at {stamp / 1e9:.3f} s, {why}; {self.frames_lost} lost", throttle_duration_sec=1.0
        )
        self._wait_for_listeners()

    def _summary(self) -> str:
        text = f"sent {self.frames_sent} frames, {self.frames_repeated} repeated, {self.frames_lost} lost"
        if self._flow.waiting:
            text += f"; {self._flow.waiting} still wait for a transform that the recording does not hold"
        return text

    def _describe(self) -> tuple[bytes, str, dict]:
        values = {
            "position_s": f"{self.position:.3f}",
            "rate": self._settings["rate"],
            "sent": self.frames_sent,
            "repeated": self.frames_repeated,
            "lost": self.frames_lost,
        }
        if self.error is not None:
            return WARN, str(self.error), values
        if self.frames_lost:
            return WARN, f"{self.frames_lost} frames were never answered", values
        return OK, "finished" if self.finished.is_set() else "playing", values


def _names(infos: Iterable[TopicEndpointInfo]) -> set[str]:
    """Full names of the nodes that endpoints belong to, as far as they are known yet."""
    return {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos if info.node_name != _UNKNOWN}


def main(args: Sequence[str] | None = None) -> int:
    """Entry point of the executable; ends when all was sent."""
    nodes: list[Replay] = []
    with contextlib.ExitStack() as stack:

        def make() -> list[Replay]:
            nodes.append(Replay(on_end=stop))
            if stack.enter_context(Keyboard(nodes[0].control.keys())).active:
                print(KEYS_HELP, file=sys.stderr)
            nodes[0].start()
            return nodes

        code = run(make, args)
    if nodes and nodes[0].error is not None:
        print(nodes[0].error, file=sys.stderr)
        return 2 if isinstance(nodes[0].error, InputError) else 1
    return code


if __name__ == "__main__":
    sys.exit(main())
