"""Node `replay`: plays a YCB-Slide sequence or a bag on the topics of a live sensor and arm."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Sequence

from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from midastouch_msgs.msg import FilterStatus
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import stamp_from_ns, stamp_ns
from midastouch_perception.ros.diagnostics import OK, WARN, Diagnostics
from midastouch_perception.ros.node import PipelineNode
from midastouch_perception.ros.parameters import Parameters
from midastouch_perception.ros.spin import run, stop

from ..frame_answers import FrameAnswers
from ..keyboard import Keyboard
from ..look_ahead import LookAhead
from ..messages import TF_TOPIC, Message, Topic
from ..playback import Playback
from ..replay_source import ReplaySource, is_image
from .message_types import live_name, message_class
from .replay_control import KEYS_HELP, ReplayControl
from .replay_parameters import PARAMETERS

RCLError = rclpy_implementation.RCLError

_DEPTH = 100  # frames that a reliable subscriber (a recorder) may lag behind before it loses some
_LEAD_NS = 500_000_000  # of transforms over images, when every image's result is waited for


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
        self._told = 0  # newest time on /clock, ns
        self._begin = (0.0, 0)  # of this round: s after the beginning, and the stamp that is, ns

        self._source = ReplaySource(self._settings["source"], self._settings["topics"].split())
        self._outputs = {topic.name: self._output(topic) for topic in self._source.topics}
        self._clock_output = self.create_publisher(Clock, "/clock", 10) if self._settings["clock"] else None
        if self._settings["ack_topic"]:
            self.create_subscription(FilterStatus, self._settings["ack_topic"], self._on_status, qos.latched(depth=50))
        self._answers = FrameAnswers(
            self._playback,
            self._settings["ack_timeout"],
            self._settings["ack_attempts"],
            self._send,
            lambda message: self._outputs[message.topic].publish(message.data),
            lambda text: self.get_logger().warning(text, throttle_duration_sec=1.0),
        )
        self.control = ReplayControl(self, self._playback, lambda: self.position)
        Diagnostics(self, self._describe)
        self._thread = threading.Thread(target=self._play, name="replay", daemon=True)

    def start(self) -> None:
        """Begin to play, in a thread of its own; the node must be spun meanwhile."""
        self._thread.start()

    @property
    def frames_repeated(self) -> int:
        """Frames that were sent again."""
        return self._answers.repeated

    @property
    def frames_lost(self) -> int:
        """Frames that were never answered."""
        return self._answers.lost

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
                self._told, self._begin = 0, (offset, 0)
                self._play_once(offset)
                self._playback.wait_while_paused()  # at its end it can still be sent back
                offset = self._playback.take_seek()
                if offset is None and not self._settings["loop"]:
                    break
                offset = self._settings["start_offset"] if offset is None else offset
            for publisher in self._outputs.values():
                publisher.wait_for_all_acked(Duration(seconds=2))
            self.get_logger().info(
                f"sent {self.frames_sent} frames, {self.frames_repeated} repeated, {self.frames_lost} lost"
            )
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
        frame: list[Message] = []
        lead = _LEAD_NS if self._settings["ack_topic"] else 0
        ahead = LookAhead(self._source.messages(lead, round(offset * 1e9)))
        for message in ahead:
            # What is latched may be of a time that is left out: neither pace nor clock begin there.
            if message.latched:
                self._outputs[message.topic].publish(message.data)
                continue
            if not self._playback.wait_until_due(message.stamp_ns, self._tick):
                return
            if self._told == 0:
                self._begin = (offset, message.stamp_ns)
            if self._settings["ack_topic"]:  # else nothing is sent again, and what has no images would pile up
                frame.append(message)
            self._send(message)
            if is_image(message.topic):
                if frame:
                    self._answers.wait(frame, ahead)
                self._playback.frame_sent()
                self.frames_sent += 1
                frame = []
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
        """Until as many as asked for listen; of a filter that acknowledges, until it listens to TF too."""
        ack_topic = self._settings["ack_topic"]
        images = [topic for topic in self._outputs if is_image(topic)]
        while not self._playback.stopped:
            waits_for = []
            missing = self._settings["wait_for_subscribers"] - sum(map(self._listeners, images))
            if missing > 0:
                waits_for.append(f"{missing} more subscribers of {' and '.join(images)}")
            if ack_topic and TF_TOPIC in self._outputs and not self._listeners(TF_TOPIC):
                waits_for.append(f"a subscriber of {TF_TOPIC}")
            if ack_topic and not self.count_publishers(ack_topic):
                waits_for.append(f"a publisher of {ack_topic}")
            if not waits_for:
                return
            self.get_logger().info(f"waiting for {', '.join(waits_for)}", throttle_duration_sec=5.0)
            time.sleep(0.02)  # of Python: rclpy's raises when the process is told to stop meanwhile

    def _listeners(self, topic: str) -> int:
        return self._outputs[topic].get_subscription_count()

    def _tick(self, recorded_ns: int) -> None:
        """Tell the recorded time; a frame sent again, or transforms sent early, do not turn it back."""
        if recorded_ns <= self._told:
            return
        self._told = recorded_ns
        if self._clock_output is not None:
            self._clock_output.publish(Clock(clock=stamp_from_ns(recorded_ns)))

    def _on_status(self, status: FilterStatus) -> None:
        self._playback.acknowledge(stamp_ns(status.header.stamp))

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
            return WARN, f"{self.frames_lost} frames were never acknowledged", values
        return OK, "finished" if self.finished.is_set() else "playing", values


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
