"""`midastouch run explore`: the nodes as processes, the run recorded, a person's keys carried on, and its page."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_filter.nodes.object_source import resolve
from midastouch_msgs.msg import ExplorerStatus, FilterStatus, Suggestion
from midastouch_msgs.srv import SetObject
from midastouch_perception.codebook import Codebook
from midastouch_perception.objects import bundled_objects

from ..bags.messages import IMAGE_TOPIC, IMAGE_TYPE, TF_TOPIC, Topic
from ..bags.run_record import OBJECTS, PENETRATION, read_run
from ..explore.page import write_page, write_words
from ..explore.preparation import prepare
from ..explore.result import Ended, ending, exploration_result, result_rows
from ..nodes.recorder import TOPICS, Recorder
from ..output_paths import quick_codebook
from ..processes.program import Program
from ..processes.supervisor import NodeFailed, Supervisor
from ..progress import progress_bar
from ..replay.keyboard import Keyboard
from ..result_file import write_json
from ..text_table import text_table
from .launch_arguments import explored, quick_codebooks
from .recording_ends import RESULTS, await_recorder, hear_the_last
from .supervised_run import supervised_run

KEYS_HELP = (
    "arrows: slide; l: lift, touch elsewhere; p: push the object; o: another object; "
    "space: take over, or let it go on; q: end"
)
_NUDGE = 0.01  # m
_HEADINGS = {"right": 0.0, "up": np.pi / 2, "left": np.pi, "down": -np.pi / 2}  # of the gel's plane
_LAST_WORDS_S = 2.0  # of the explorer, still on their way when it has ended
_ENDED = (ExplorerStatus.STATE_KNOWN, ExplorerStatus.STATE_GAVE_UP)


def run_exploration(programs: Sequence[Program], given: Mapping[str, str], out: Path, domain: int) -> int:
    """Let the finger explore until it is over or a person ends it, then draw; returns the exit status.

    programs: the nodes, `explorer` among them; given: mesh, codebook and objects, as of `explored`. domain:
    ROS_DOMAIN_ID, on this machine alone. 0: object and place are known and right, or a person has ended it; 1: not, or
    a node died.
    """
    out.mkdir(parents=True, exist_ok=True)
    touched, codebook, objects = _path_of(given["mesh"]), given["codebook"], given["objects"]
    bag, started = out / "run.mcap", time.monotonic()
    untold = f", for the filter one of {len(objects.split(','))} objects" if objects else ""
    print(f"a simulated finger explores '{Path(touched).stem}'{untold}")
    print(f"live in a browser, from another terminal: ROS_DOMAIN_ID={domain} midastouch view", flush=True)
    with atomic_path(bag) as temporary:
        seat = _explore(programs, touched, temporary, out / "log", domain)
    seconds = time.monotonic() - started
    try:
        record = read_run(bag)
    except InputError as error:  # it ended before the filter had an answer
        result = ending(seat.ended, Path(seat.mesh).stem, seconds)
        _tell(result, out)
        print(f"the same as a page: {write_words(result, str(error), out)}")
        return 0 if seat.ended.by_hand else 1
    if seat.mesh != touched:  # a person has changed it, and told: what came before was about another one
        record = record.last(1e-9 * seat.since_change_ns).told()
        changed = {"mesh": seat.mesh, "codebook": "", "objects": ""}
        prepare(quick_codebooks(changed))
        touched, codebook = seat.mesh, explored(changed)["codebook"]
    mesh = ObjectMesh.load(touched)
    result = exploration_result(record, mesh.name, seat.ended, seat.answering, seconds)
    _tell(result, out)
    page = write_page(record.snapshots, mesh, Codebook.load(codebook, mesh), result, out)
    print(f"pictures and table: {page}\nrecording: {bag}")
    return 0 if result["right"] or seat.ended.by_hand else 1


def _tell(result: dict, out: Path) -> None:
    write_json(out / "result.json", result)
    print(f"\n{text_table(*result_rows(result))}\n", flush=True)


def _explore(programs: Sequence[Program], mesh: str, bag: Path, logs: Path, domain: int) -> _Seat:
    """Returns who has seen how it ended."""
    with supervised_run(domain, logs) as (supervisor, executor):
        executor.add_node(recorder := _recorder(bag, mesh, executor.context))
        executor.add_node(seat := _Seat(mesh, executor.context))
        for program in programs:
            supervisor.start(_held_back(program) if program.ends else program)
        with Keyboard(seat.keys()) as keyboard:
            if keyboard.active:
                print(KEYS_HELP, flush=True)
            _follow(executor, supervisor, recorder, seat)
        return seat


def _held_back(explorer: Program) -> Program:
    """The same, which does not move the finger before somebody is ready for it."""
    return replace(explorer, command=(*explorer.command, "-p", "start_paused:=true"))


def _recorder(bag: Path, mesh: str, context: rclpy.Context) -> Recorder:
    topics = (
        *TOPICS,
        Topic(PENETRATION, IMAGE_TYPE),
        Topic(OBJECTS, "vision_msgs/msg/Detection3DArray", latched=True),
        Topic("/explorer/status", "midastouch_msgs/msg/ExplorerStatus", latched=True),
    )
    overrides = [Parameter("path", value=str(bag))]
    return Recorder(topics, {"object": Path(mesh).stem}, parameter_overrides=overrides, context=context)


def _follow(executor: SingleThreadedExecutor, supervisor: Supervisor, recorder: Recorder, seat: _Seat) -> None:
    """Let the finger move once nothing of it is lost, and spin until the exploration is over."""

    def turn() -> bool:
        executor.spin_once(timeout_sec=0.1)
        seat.carry_out_keys()
        supervisor.look_after()
        return seat.ended is None

    def still_to_come() -> str:
        # others publish on /tf, too: that the explorer is connected shows in what arrives
        return "" if recorder.counts[TF_TOPIC] else "the finger's transforms"

    try:
        if await_recorder(recorder, (IMAGE_TOPIC, *RESULTS), turn, still_to_come):
            while turn():
                seat.let_begin()
    except NodeFailed as error:
        # the explorer ends like that when it gives up
        deadline = time.monotonic() + _LAST_WORDS_S
        while seat.ended is None and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.1)
        if seat.ended is None:
            print(f"midastouch: error: {error}", file=sys.stderr)
            seat.fail(error.cause)
    hear_the_last(executor)


class _Seat(Node):
    """Where a person sits: sees how it goes, and has keys.

    Attributes: ended, how it did, None until then; answering [s], from the filter's first answer to the newest; mesh,
    that of the object; since_change_ns, how long it has been that, in the finger's time.
    """

    def __init__(self, mesh: str, context: rclpy.Context):
        super().__init__("explore", context=context)
        self.mesh, self._newest, self._changed = mesh, 0, 0
        self.ended: Ended | None = None
        self._first_at: float | None = None
        self.answering = 0.0
        self._pressed: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self._held = True
        self._explorer, self._filter, self._bar = ExplorerStatus(), "", progress_bar(unit="image")
        self._move = self.create_publisher(Suggestion, "explorer/move", qos.COMMAND)
        self._callable = {
            name: self.create_client(Trigger, f"explorer/{name}") for name in ("pause", "resume", "push", "lift")
        }
        self._set_object = self.create_client(SetObject, "explorer/set_object")
        self.create_subscription(MarkerArray, "explorer/object_mesh", self._on_mesh, qos.latched())
        self.create_subscription(ExplorerStatus, "explorer/status", self._on_explorer, qos.latched())
        self.create_subscription(FilterStatus, "filter_status", self._on_filter, qos.latched(depth=100))

    def keys(self) -> dict[str, Callable[[], None]]:
        """What the keys of `Keyboard` do; it is done by `carry_out_keys`."""
        does = {name: lambda heading=heading: self._nudge(heading) for name, heading in _HEADINGS.items()}
        does |= {"l": lambda: self._call("lift"), "p": lambda: self._call("push")}
        does |= {"o": self._change_object, " ": self._turn_over, "q": self._quit}
        return {key: lambda do=do: self._pressed.put(do) for key, do in does.items()}

    def let_begin(self) -> None:
        """Let the explorer go that was started paused, once it is, unless a person has taken it since."""
        if self._held and self._paused and self._callable["resume"].service_is_ready():
            self._held = False
            self._call("resume")

    def carry_out_keys(self) -> None:
        """Do what the pressed keys mean, in the thread that spins."""
        try:
            while True:
                self._pressed.get_nowait()()
                self._held = self._held and not self._paused
        except Empty:
            return

    def destroy_node(self) -> None:
        """Leave the progress as it is."""
        self._bar.close()
        super().destroy_node()

    def _nudge(self, heading: float) -> None:
        self._move.publish(Suggestion(heading=heading, length=_NUDGE))

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

    def _turn_over(self) -> None:
        self._call("resume" if self._paused else "pause")

    def _quit(self) -> None:
        self.ended = Ended.of(self._explorer, by_hand=True)

    def fail(self, why: str) -> None:
        """It ended because a node died."""
        self.ended = replace(Ended.of(self._explorer), state="failed", reason=why)

    @property
    def _paused(self) -> bool:
        return self._explorer.state == ExplorerStatus.STATE_PAUSED

    @property
    def since_change_ns(self) -> int:
        return self._newest - self._changed

    def _on_mesh(self, markers: MarkerArray) -> None:
        for marker in markers.markers:
            address = marker.mesh_resource
            if marker.action == Marker.ADD and address and (path := _path_of(address)) != self.mesh:
                self.mesh, self._changed = path, self._newest

    def _on_filter(self, status: FilterStatus) -> None:
        if status.state == FilterStatus.STATE_WAITING:
            return
        self._newest = stamp_ns(status.header.stamp)
        self._first_at = self._first_at or time.monotonic()
        self.answering = time.monotonic() - self._first_at
        self._filter = f"{status.state}, {status.n_particles} particles"
        self._bar.update()
        self._show()

    def _on_explorer(self, status: ExplorerStatus) -> None:
        self._explorer = status
        self._show()
        if status.state in _ENDED and self.ended is None:
            self.ended = Ended.of(status)

    def _show(self) -> None:
        path = f"{1e3 * self._explorer.path_length:.0f} mm"
        self._bar.set_postfix_str(f"{self._explorer.state} {path} | {self._filter}", refresh=False)


def _path_of(address: str) -> str:
    """The file that the address of a mesh means."""
    return str(resolve(address, "mesh").resolve())
