"""The terminal of `midastouch run explore`: it shows the progress, and its keys steer the finger."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue

import numpy as np
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger
from vision_msgs.msg import Detection3DArray
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import probabilities_from_msg, stamp_ns
from midastouch_common.output_paths import quick_codebook
from midastouch_common.ros import qos
from midastouch_common.ros.addresses import resolve
from midastouch_filter.identification.identity import UNKNOWN
from midastouch_msgs.msg import ExplorerStatus, FilterStatus, Suggestion
from midastouch_msgs.srv import SetObject
from midastouch_perception.objects import bundled_objects

from ..exploration_result import end_of
from ..progress import progress_bar

_OF_A_FINGER = "p: push the object; o: another object; "
_NUDGE = 0.01  # m
_LIKELY = 0.9  # probability of an object
_LONGEST_NAME, _LONGEST_REASON = 28, 36  # with them, a line has at most 100 columns, and 64 beside a reason
_HEADINGS = {"right": 0.0, "up": np.pi / 2, "left": np.pi, "down": -np.pi / 2}  # of the gel's plane
_OF_NO_FRAME = (FilterStatus.STATE_UNINITIALISED, FilterStatus.STATE_STALE)  # stamped by another clock than images
_END_STATES = (ExplorerStatus.STATE_KNOWN, ExplorerStatus.STATE_GAVE_UP)


class Console(Node):
    """Node that shows the progress of an exploration, and sends the commands of the pressed keys.

    Attributes: ended: as of `end_of`, None before the end; answering [s]: from the filter's first answer to the newest;
    mesh: of the object; since_change_ns: on the finger's clock, from the first answer about that object to the newest,
    None before one.
    Args: mesh: of the object at the start; given: True if the filter was given the object.
    """

    def __init__(self, mesh: str, given: bool, context: rclpy.Context):
        super().__init__("explore", context=context)
        self.mesh, self._newest = mesh, 0
        self._changed: int | None = None
        self.ended: dict | None = None
        self._first_at: float | None = None
        self.answering = 0.0
        self._pressed: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self._resumed = self._begun = False  # begun: it has moved, or a person has taken it
        self._explorer = ExplorerStatus(state=ExplorerStatus.STATE_WAITING)
        self._filter = FilterStatus(state=FilterStatus.STATE_WAITING)
        self._objects: dict[str, float] = {}
        self._given = Path(mesh).stem if given else ""
        self._started, self._bar = time.monotonic(), progress_bar(bar_format="{desc}")
        self._move = self.create_publisher(Suggestion, "explorer/move", qos.COMMAND)
        self._callable = {
            name: self.create_client(Trigger, f"explorer/{name}") for name in ("pause", "resume", "push", "lift")
        }
        self._set_object = self.create_client(SetObject, "explorer/set_object")
        self.create_subscription(MarkerArray, "explorer/object_mesh", self._on_mesh, qos.latched())
        self.create_subscription(ExplorerStatus, "explorer/status", self._on_explorer, qos.latched())
        self.create_subscription(Detection3DArray, "object_hypotheses", self._on_objects, qos.latched())
        self.create_subscription(FilterStatus, "filter_status", self._on_filter, qos.latched(depth=100))

    def keys(self) -> dict[str, Callable[[], object]]:
        """Return the function of each key of `Keyboard`; it queues a command for `carry_out_keys`."""
        does: dict[str, Callable[[], object]] = {
            key: partial(self._move.publish, Suggestion(heading=heading, length=_NUDGE))
            for key, heading in _HEADINGS.items()
        }
        does |= {"l": partial(self._call, "lift"), "p": partial(self._call, "push"), "o": self._change_object}
        does |= {" ": lambda: self._call("resume" if self._paused else "pause"), "q": self.quit}
        return {key: partial(self._pressed.put, do) for key, do in does.items()}

    def let_begin(self) -> None:
        """Let an explorer that was started paused begin, unless a person has taken the finger meanwhile."""
        if not (self._resumed or self._begun) and self._paused and self._callable["resume"].service_is_ready():
            self._resumed = True
            self._call("resume")

    def carry_out_keys(self) -> None:
        """Carry out the commands of the pressed keys, in the thread that spins."""
        try:
            while True:
                self._pressed.get_nowait()()
                self._begun |= self._paused
        except Empty:
            return

    def destroy_node(self) -> None:
        """Close the progress bar, then destroy the node."""
        self._bar.close()
        super().destroy_node()

    def _call(self, name: str) -> None:
        if self._callable[name].service_is_ready():
            self._callable[name].call_async(Trigger.Request())

    def _change_object(self) -> None:
        """Ask for the bundled object after this one."""
        objects = {name: str(path) for name, path in sorted(bundled_objects().items())}
        names, now = list(objects), Path(self.mesh).stem
        following = names[(names.index(now) + 1) % len(names) if now in names else 0]
        codebook = quick_codebook(following).resolve()
        request = SetObject.Request(mesh_path=objects[following])
        request.codebook_path = str(codebook) if codebook.is_file() else ""
        if self._set_object.service_is_ready():
            self._set_object.call_async(request)

    def quit(self) -> None:
        """End the exploration for a person."""
        self.ended = end_of(self._explorer, by_hand=True)

    def fail(self, why: str) -> None:
        """End the exploration because a node died."""
        self.ended = {**end_of(self._explorer), "ended": "failed", "reason": why}

    @property
    def _paused(self) -> bool:
        return self._explorer.state == ExplorerStatus.STATE_PAUSED

    @property
    def since_change_ns(self) -> int | None:
        return None if self._changed is None else self._newest - self._changed

    def _on_mesh(self, markers: MarkerArray) -> None:
        for marker in markers.markers:
            address = marker.mesh_resource
            if marker.action == Marker.ADD and address and (path := file_of(address)) != self.mesh:
                self.mesh, self._changed = path, None
                self._objects, self._given = {}, Path(path).stem

    def _on_objects(self, objects: Detection3DArray) -> None:
        try:
            self._objects = probabilities_from_msg(objects)
        except InputError as error:
            self.get_logger().warning(f"object_hypotheses: {error}", throttle_duration_sec=5.0)
        self._show()

    def _on_filter(self, status: FilterStatus) -> None:
        if status.state == FilterStatus.STATE_WAITING:
            return
        if status.state not in _OF_NO_FRAME:
            self._newest = stamp_ns(status.header.stamp)
            self._changed = self._newest if self._changed is None else self._changed
        self._first_at = self._first_at or time.monotonic()
        self.answering = time.monotonic() - self._first_at
        self._filter = status
        self._show()
        self._bar.update()

    def _on_explorer(self, status: ExplorerStatus) -> None:
        self._explorer = status
        self._begun |= status.state == ExplorerStatus.STATE_EXPLORING
        self._show()
        self._bar.update()
        if self.ended is None and status.state in _END_STATES:
            self.ended = end_of(status)
        elif self.ended is not None and self.ended["by_hand"]:  # with the path of the motion that was cut off
            self.quit()

    def _show(self) -> None:
        explorer, known, seconds = self._explorer, self._filter, time.monotonic() - self._started
        answer, pose = object_answer(self._objects, self._given), f"best pose {known.mode_mass:.0%}"
        state = ExplorerStatus.STATE_WAITING if self._paused and not self._begun else explorer.state
        if state == ExplorerStatus.STATE_PAUSED:
            pose = pose if known.mode_mass or self._given else answer
            room = max(_LONGEST_REASON, shutil.get_terminal_size().columns - 64)
            answer = _shortened(explorer.reason.partition("; ~/")[0], room)  # here it is a key that resumes
        line = progress_line(state, explorer.path_length, seconds, answer, known.state, pose)
        self._bar.set_description_str(line, refresh=False)


def keys_help(finger: bool) -> str:
    """Return the help on the keys; finger: True if the arm is the finger without mechanics."""
    of_finger = _OF_A_FINGER if finger else ""
    return f"arrows: slide; l: lift, touch elsewhere; {of_finger}space: take over, or let it continue; q, Ctrl-C: end"


def file_of(address: str) -> str:
    """Return the file that the address of a mesh stands for."""
    return str(resolve(address, "mesh").resolve())


def progress_line(state: str, path_length: float, seconds: float, answer: str, filter_state: str, pose: str) -> str:
    """Return a line of at most 100 columns: the explorer's state, its path [m], seconds since the start, which object
    it is, the filter's state and its best pose in words.

    answer: from `object_answer`, or what became of a person's order.
    """
    done = f"{state}, {1e3 * path_length:.0f} mm, {seconds:.0f} s"
    return f"{done} | {answer} | {filter_state}, {pose}"


def object_answer(objects: Mapping[str, float], given: str) -> str:
    """Return the name of the most probable object, with "perhaps" before it until it is likely. Without probabilities,
    return `given`, the name of the object that the filter was given, or "no object yet" if that is empty."""
    if not objects:
        return _shortened(given) if given else "no object yet"
    name = max(objects, key=objects.get)
    if name == UNKNOWN:
        return "none of the objects" if objects[name] > _LIKELY else "no object yet"
    return f"{'' if objects[name] > _LIKELY else 'perhaps '}{_shortened(name)}"


def _shortened(text: str, most: int = _LONGEST_NAME) -> str:
    return text if len(text) <= most else f"{text[: most - 3]}..."
