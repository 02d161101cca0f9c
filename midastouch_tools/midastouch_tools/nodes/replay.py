"""Node `replay`: plays a bag, a YCB-Slide sequence or plain images on the topics of a live sensor and arm."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable

from rclpy.clock import Clock, ClockType

from midastouch_common.errors import InputError
from midastouch_common.ros.diagnostics import OK, PERIOD_S, WARN, Diagnostics, LastingWarnings
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_common.ros.private_rclpy import RCLError
from midastouch_common.ros.spin import run, stop

from ..replay.flow_control import FlowControl
from ..replay.keyboard import Keyboard
from ..replay.playback import Playback
from ..replay.player import Player
from ..replay.source import ReplaySource, parsed_remaps
from ..text_table import counted
from .replay_control import KEYS_HELP, ReplayControl
from .replay_listeners import FilterAnswers, Listeners, ReplayOutput

PARAMETERS = (
    Parameter("source", "", "Bag (.mcap file or rosbag2 folder), YCB-Slide sequence, folder of images or video"),
    Parameter("remap", "", "Topics of a bag that are played on others: FROM:=TO, separated by spaces"),
    Parameter(
        "rotation",
        0,
        "Turn of the images of a bag or folder, counter-clockwise; 90 for those in the camera's own landscape order",
        "deg",
        choices=(0, 90, 180, 270),
    ),
    Parameter(
        "rate", 1.0, "Recorded seconds per second; 0: as fast as it goes", minimum=0.0, maximum=1000.0, read_only=False
    ),
    Parameter("clock", False, "Publish /clock, for nodes with use_sim_time"),
    Parameter("loop", False, "Start again at the end; time jumps back", read_only=False),
    Parameter("start_paused", False, "Wait for the service resume or step"),
    Parameter(
        "seek_to",
        0.0,
        "Each time it is set, continue this long after the beginning; a pause stays",
        "s",
        minimum=0.0,
        maximum=1e10,
        read_only=False,
    ),
    Parameter("wait_for_nodes", "", "Lifecycle nodes to be active before anything is sent, separated by spaces"),
    Parameter("wait_for_subscribers", 0, "Start when the images have this many subscribers", minimum=0, maximum=100),
    Parameter(
        "ack_topic",
        "",
        "FilterStatus topic of the filter: the next image waits until the one before is answered there, so that none "
        "is lost however slow the filter is; empty: do not wait",
    ),
    Parameter(
        "ack_timeout",
        5.0,
        "An image is given up if the filter, though at work, does not mention it for this time; time in which "
        "it is busy or loads does not count",
        "s",
        minimum=0.05,
        maximum=3600.0,
    ),
)

_LONG_S = 10.0  # wait for the next message that is worth a warning
_PROGRESS_EVERY_S = 10.0


class Replay(PipelineNode):
    """Node that publishes images, camera info, TF and ground truth; `start()` begins, `finished` is set at the end.

    `on_end` is called from the playing thread once all is sent or the source fails; `error` then holds the reason.
    `player` has the position and the number of frames sent.
    """

    def __init__(self, on_end: Callable[[], None] = lambda: None, **kwargs) -> None:
        super().__init__("replay", **kwargs)
        self._settings = Parameters(self, PARAMETERS)
        if not self._settings["source"]:
            raise InputError(
                "replay: parameter 'source' is empty; give a bag, a sequence, a folder of images or a video"
            )
        self._on_end = on_end
        self.finished = threading.Event()
        self.error: Exception | None = None

        remaps = parsed_remaps(self._settings["remap"].split())
        source = ReplaySource(self._settings["source"], self._on_broken, remaps, self._settings["rotation"])
        self._output = ReplayOutput(self, source.topics, self._settings["clock"])
        self._playback = Playback(self._settings["rate"], self._settings["start_paused"])
        timeout_reports = max(1, round(self._settings["ack_timeout"] / PERIOD_S))
        flow = FlowControl(self._playback, timeout_reports, lambda: bool(answers.publishers()), self._on_lost)
        topic = self._settings["ack_topic"]
        answers = self._answers = FilterAnswers(self, topic, flow) if topic else None
        nodes, subscribers = self._settings["wait_for_nodes"].split(), self._settings["wait_for_subscribers"]
        self._listeners = Listeners(self, self._output, answers, nodes, subscribers)
        self.player = Player(source, self._playback, flow, answers is not None, self._output.send, self._output.tell)
        self.control = ReplayControl(self, self._playback, lambda: self.player.position, source.duration_s)
        self._duration = source.duration_s
        self.create_timer(_PROGRESS_EVERY_S, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._lasting = LastingWarnings(self)
        Diagnostics(self, self._describe)
        self._thread = threading.Thread(target=self._play, name="replay", daemon=True)

    def start(self) -> None:
        """Begin to play, in a thread of its own; the node must be spun meanwhile."""
        self._thread.start()

    def destroy_node(self) -> None:
        """Stop playing, then destroy the node."""
        self._playback.stop()
        if self._thread.is_alive():
            self._thread.join()
        super().destroy_node()

    def _play(self) -> None:
        try:
            self._await_listeners()
            self.player.play(lambda: self._settings["loop"])
            self._output.flush()
            self.get_logger().info(f"{self.player.summary()}{self._state}")
        except Exception as error:
            if isinstance(error, RCLError) and not self.context.ok():
                return  # the process was told to stop in the middle of a call
            self.error = error  # of any type: this end must not count as a success
            if not isinstance(error, InputError):
                raise
        finally:
            self.finished.set()
            self._on_end()

    @property
    def _state(self) -> str:
        return f"; the filter is {self._answers.state}" if self._answers and self._answers.state else ""

    def _tell(self) -> None:
        if self.player.frames_sent and not (self._playback.paused or self.finished.is_set()):
            self.get_logger().info(f"{self.player.position:.0f} of {self._duration:.0f} s{self._state}")

    def _await_listeners(self) -> None:
        self._listeners.wait(lambda: self._playback.stopped)

    def _on_lost(self, stamp: int, why: str) -> None:
        self.get_logger().warning(
            f"no answer to the image at {stamp / 1e9:.3f} s, {why}; {self.player.frames_lost} lost",
            throttle_duration_sec=1.0,
        )
        self._await_listeners()

    def _on_broken(self, reason: str) -> None:
        self.get_logger().warning(f"{reason}; left out", throttle_duration_sec=1.0)

    def _describe(self) -> tuple[bytes, str, dict]:
        if self.player.frames_sent and not self.finished.is_set():
            unheard = self._listeners.unheard
            start = "midastouch run localization use_sim_time:=true object:=NAME"
            why = f"nothing subscribes to {unheard}: for poses of a bundled object, start {start}"
            self._lasting.observe({"unheard": why} if unheard else {})
        values = {
            "position_s": f"{self.player.position:.3f}",
            "rate": self._settings["rate"],
            "sent": self.player.frames_sent,
            "repeated": self.player.frames_repeated,
            "lost": self.player.frames_lost,
            "broken": self.player.frames_broken,
        }
        if self.error is not None:
            return WARN, str(self.error), values
        if self.player.frames_lost:
            return WARN, f"{counted(self.player.frames_lost, 'frame')} never answered", values
        if self.player.frames_broken:
            return WARN, f"{counted(self.player.frames_broken, 'broken image')} left out", values
        if (gap := self._playback.remaining) > _LONG_S:
            return WARN, f"nothing is recorded for {gap:.0f} s: set seek_to to continue after the gap", values
        return OK, "finished" if self.finished.is_set() else "playing", values


def main(args: list[str] | None = None) -> int:
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
