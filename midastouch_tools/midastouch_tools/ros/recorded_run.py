"""Recording of a sequence that is played through the real nodes, as processes of their own, into a bag."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.graph_watch import LifecycleWatch
from midastouch_msgs.msg import FilterStatus

from ..bags.messages import IMAGE_TYPE, Topic
from ..bags.run_record import CODE, MODES, PARTICLES, PENETRATION, STATUS
from ..datasets import Sequence as RecordedSequence
from ..demo import NODES
from ..nodes.recorder import TOPICS, Recorder
from ..processes.local_domain import LogFolder, local_environment
from ..processes.process import Process, node_program
from ..processes.supervisor import NodeFailed, Supervisor
from ..progress import progress_bar
from .local_context import local_context

RESULTS = (CODE, PENETRATION, MODES, PARTICLES, STATUS)
"""Topics that the nodes of a run add to a bag."""

_SILENCE_S = 120.0  # without a status during the replay, or without a node that is awaited
_LAST_STATUS_S = 5.0
_ON_THEIR_WAY_S = 0.5


@contextlib.contextmanager
def supervised_run(
    domain: int, logs: Path, await_ends: Callable[[list[Process], float], object] | None = None
) -> Iterator[tuple[Supervisor, SingleThreadedExecutor]]:
    """Provide a supervisor of programs, whose output goes to `logs`, and an executor for nodes made in its `context`.

    At the end the executor's nodes are destroyed, then the programs are ended, as `process.end` does it.
    """
    environment = local_environment(domain, ROS_LOG_DIR=str(logs.resolve()))
    with local_context(domain) as context, Supervisor(environment, LogFolder(logs)) as supervisor:
        executor = SingleThreadedExecutor(context=context)
        try:
            yield supervisor, executor
        finally:
            nodes = executor.get_nodes()
            executor.shutdown()
            for node in nodes:
                node.destroy_node()
            supervisor.end(await_ends)


def record_run(sequence: RecordedSequence, parameters: Path, bag: Path, logs: Path, domain: int) -> float:
    """Play a sequence through the nodes into a bag; returns the seconds from the first answered frame to the last.

    domain: ROS_DOMAIN_ID, on this machine alone. Raises NodeFailed when a node dies or falls silent, InputError for one
    that is not installed.
    """
    with supervised_run(domain, logs) as (supervisor, executor):
        for name in NODES:
            supervisor.start(node_program(name, parameters))
        metadata = {"object": sequence.object_name, "sequence": sequence.name, "layout": sequence.layout}
        executor.add_node(recorder := recorder_of_run(bag, metadata, executor.context, sim_time=True))
        executor.add_node(listener := _Listener(sequence, executor.context))

        def turn() -> bool:
            executor.spin_once(timeout_sec=0.1)
            supervisor.look_after()
            return True

        await_recorder(recorder, RESULTS, turn, lambda: listener.consumers.waiting_for)
        supervisor.start(node_program("replay", parameters, ends=True))
        while "replay" in supervisor.pids:
            turn()
            if time.monotonic() - listener.heard_at > _SILENCE_S:
                raise NodeFailed(f"no filter_status for {_SILENCE_S:g} s; see the logs in the output folder")
        ended = time.monotonic()
        while not listener.done:
            turn()
            if time.monotonic() - ended > _LAST_STATUS_S:
                raise NodeFailed("the replay has ended, but its last frame was never answered")
        hear_the_last(executor)
        return listener.seconds


def recorder_of_run(
    bag: Path, metadata: dict[str, str], context: rclpy.Context, topics: Sequence[Topic] = (), sim_time: bool = False
) -> Recorder:
    """Return a recorder of what a run sends, with its penetration maps and further topics, into a new bag."""
    topics = (*TOPICS, Topic(PENETRATION, IMAGE_TYPE), *topics)
    overrides = [Parameter("path", value=str(bag)), Parameter("use_sim_time", value=sim_time)]
    return Recorder(topics, metadata, parameter_overrides=overrides, context=context)


class _Listener(Node):
    """Node that shows the filter's progress in a bar, and watches which nodes are active."""

    def __init__(self, sequence: RecordedSequence, context: rclpy.Context):
        super().__init__("demo", context=context)
        self._last_stamp = int(sequence.stamps_ns[-1])
        self._bar = progress_bar(total=sequence.n_frames, unit="frame")
        self._seen: set[int] = set()
        self.heard_at = self._first_at = time.monotonic()
        self.done = False
        self.consumers = LifecycleWatch(self, NODES)
        self.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched(depth=100))

    @property
    def seconds(self) -> float:
        """Seconds from the first answered frame to the newest."""
        return self.heard_at - self._first_at

    def _on_status(self, status: FilterStatus) -> None:
        stamp = stamp_ns(status.header.stamp)
        if status.state == FilterStatus.STATE_WAITING or status.n_particles == 0 or stamp in self._seen:
            return
        self.heard_at = time.monotonic()
        if not self._seen:
            self._first_at = self.heard_at
        self._seen.add(stamp)
        belief = f"{status.state}, hypotheses: {status.n_particles}, modes: {status.n_modes}"
        self._bar.set_postfix_str(belief, refresh=False)
        self._bar.update()
        self.done = stamp >= self._last_stamp

    def destroy_node(self) -> None:
        self._bar.close()
        super().destroy_node()


def await_recorder(
    recorder: Recorder, topics: Sequence[str], turn: Callable[[], bool], others: Callable[[], str] = str
) -> bool:
    """Wait until the recorder hears all the topics: a frame sent earlier would be lost. Return whether it does.

    turn: spins once, and returns whether to keep waiting. others: names other parts that are awaited, empty if none is.
    Raises NodeFailed after two minutes.
    """
    started = time.monotonic()
    while waiting := others() or ", ".join(recorder.unheard(topics)):
        if not turn():
            return False
        if time.monotonic() - started > _SILENCE_S:
            raise NodeFailed(f"still waiting for {waiting} after {_SILENCE_S:g} s; see the logs in the output folder")
    return True


def hear_the_last(executor: Executor) -> None:
    """Spin a while: messages of the nodes may still be on their way to the recorder."""
    quiet_until = time.monotonic() + _ON_THEIR_WAY_S
    while time.monotonic() < quiet_until:
        executor.spin_once(timeout_sec=0.05)
