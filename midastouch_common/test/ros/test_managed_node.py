"""A lifecycle node driven over DDS as by nav2's lifecycle manager, and one that starts by itself."""

from __future__ import annotations

import gc
import time
import weakref

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import TransitionEvent
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter as RclpyParameter
from std_msgs.msg import String

from midastouch_common.errors import InputError
from midastouch_common.ros import diagnostics, qos
from midastouch_common.ros.managed_node import AUTOSTART, ManagedNode
from midastouch_common.ros.parameters import Parameter

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("brisk_health")]
WAITING = {"autostart": False}
UNCONFIGURED = "not configured (ros2 lifecycle set)"


class Reader(ManagedNode):
    """Loads a "file" by name: `good`, one that cannot be used, or one that reveals a bug."""

    def __init__(self, while_loading=lambda: None, **options):
        table = (
            Parameter("file", "good", "What to load", former="path"),
            Parameter("speed", 1.0, "Changes while it runs", read_only=False),
            Parameter("depth", 1, "Read once", at_start=True),
            AUTOSTART,
        )
        super().__init__("reader", table, **options)
        self.loaded, self.heard, self.ended = None, [], 0
        self._while_loading = while_loading
        self.autostart()

    def configure(self):
        self.say(f"loading {self.parameters['file']}")
        self._while_loading()
        self.loaded = self.parameters["file"]
        if self.loaded == "bad":
            raise InputError("bad: not a file; choose another")
        if self.loaded == "bug":
            raise ZeroDivisionError("of something")

    def unload(self):
        self.loaded = None

    def connect(self):
        if self.loaded == "deaf":
            raise InputError("deaf: cannot listen")
        self.create_subscription(String, "words", self.heard.append, qos.COMMAND)
        self.create_timer(1000.0, lambda: None)

    def disconnect(self):
        self.ended += 1
        if self.loaded == "stuck":
            raise OSError("it does not let go")

    def describe(self):
        return diagnostics.OK, "hears", {"words": len(self.heard)}


def expect(graph, health, level: bytes, message: str, **values) -> None:
    """Spin until the newest diagnostics say so."""

    def reported() -> bool:
        status = health.newest
        sent = {pair.key: pair.value for pair in status.values} if status else {}
        return status is not None and (status.level, status.message, sent) == (level, message, values)

    graph.spin_until(reported, message)


def subscribers(graph) -> int:
    return graph.companion.count_subscribers("words")


def test_a_former_parameter_name_does_not_keep_it_inactive(graph):
    node = graph.add(Reader, {"path": "other"})
    assert (node.active, node.loaded) == (True, "other")


def test_a_manager_takes_it_through_its_whole_life(graph):
    node = graph.add(Reader, WAITING)
    health = graph.health()
    events = graph.listen(TransitionEvent, "reader/transition_event")
    assert graph.state_of("reader") == "unconfigured"
    assert not graph.change_state("reader", "activate"), "must be configured first"
    expect(graph, health, diagnostics.WARN, UNCONFIGURED, lifecycle="unconfigured")

    for _ in range(2):
        assert graph.change_state("reader", "configure")
        assert (graph.state_of("reader"), node.loaded, subscribers(graph)) == ("inactive", "good", 0)
        inactive = "configured, but not active (ros2 lifecycle set)"
        expect(graph, health, diagnostics.WARN, inactive, lifecycle="inactive")
        for _ in range(2):
            assert graph.change_state("reader", "activate")
            graph.spin_until(lambda: subscribers(graph) == 1, "the subscription")
            words = graph.publisher(String, "words")
            words.publish(String(data="x"))
            before = len(node.heard)
            graph.spin_until(lambda before=before: len(node.heard) > before, "the word")
            expect(graph, health, diagnostics.OK, "hears", lifecycle="active", words=str(len(node.heard)))
            timers = len(list(node.timers))
            assert graph.change_state("reader", "deactivate")
            graph.spin_until(lambda: subscribers(graph) == 0, "the subscription's end")
            assert len(list(node.timers)) == timers - 1
        assert graph.change_state("reader", "cleanup")
        assert (graph.state_of("reader"), node.loaded) == ("unconfigured", None)
    assert node.ended == 4

    assert graph.change_state("reader", "configure")
    assert graph.change_state("reader", "activate")
    assert graph.change_state("reader", "active_shutdown")
    assert (graph.state_of("reader"), node.loaded, node.ended) == ("finalized", None, 5)
    graph.spin_until(lambda: events and events[-1].goal_state.label == "finalized", "the last event")


def test_what_cannot_be_loaded_is_told_and_can_be_mended(graph):
    node = graph.add(Reader, {**WAITING, "file": "bad"})
    health = graph.health()
    logs = graph.listen(Log, "/rosout", latched=True)
    assert not graph.change_state("reader", "configure")
    assert (graph.state_of("reader"), node.loaded) == ("unconfigured", None)
    expect(graph, health, diagnostics.ERROR, "bad: not a file; choose another", lifecycle="unconfigured")
    graph.spin_until(lambda: any(log.msg == "bad: not a file; choose another" for log in logs), "the log")

    assert graph.set_parameter("reader", "file", "good").successful
    assert graph.change_state("reader", "configure")
    assert graph.change_state("reader", "activate")
    expect(graph, health, diagnostics.OK, "hears", lifecycle="active", words="0")


def test_what_fails_at_activation_leaves_it_inactive(graph):
    node = graph.add(Reader, {**WAITING, "file": "deaf"})
    health = graph.health()
    assert graph.change_state("reader", "configure")
    assert not graph.change_state("reader", "activate")
    assert graph.state_of("reader") == "inactive"
    expect(graph, health, diagnostics.ERROR, "deaf: cannot listen", lifecycle="inactive")
    assert graph.change_state("reader", "cleanup")
    expect(graph, health, diagnostics.WARN, UNCONFIGURED, lifecycle="unconfigured")
    assert node.ended == 1


def test_a_bug_fails_the_transition_and_is_named(graph):
    graph.add(Reader, {**WAITING, "file": "bug"})
    health = graph.health()
    assert not graph.change_state("reader", "configure")
    assert graph.state_of("reader") == "unconfigured"
    expect(graph, health, diagnostics.ERROR, "ZeroDivisionError: of something", lifecycle="unconfigured")


def test_a_bug_while_it_stops_is_named_too(graph):
    node = graph.add(Reader, {**WAITING, "file": "stuck"})
    health = graph.health()
    assert graph.change_state("reader", "configure")
    assert graph.change_state("reader", "activate")
    assert not graph.change_state("reader", "deactivate")
    expect(graph, health, diagnostics.ERROR, "OSError: it does not let go", lifecycle="active")
    node.loaded = "good"
    assert graph.change_state("reader", "deactivate")
    assert subscribers(graph) == 0


def test_an_override_of_an_unknown_topic_fails_the_activation(graph):
    graph.add(Reader, {**WAITING, "qos_overrides./wrods.subscription.depth": 3})
    health = graph.health()
    assert graph.change_state("reader", "configure")
    assert not graph.change_state("reader", "activate")
    health.until("no parameter 'qos_overrides./wrods.subscription.depth'")
    assert subscribers(graph) == 0


@pytest.mark.parametrize(("file", "error"), [("bad", InputError), ("bug", ZeroDivisionError), ("deaf", InputError)])
def test_a_failed_start_by_itself_leaves_nothing_behind(graph, file, error):
    with pytest.raises(error):
        graph.add(Reader, {"file": file})
    graph.spin_until(lambda: "reader" not in graph.companion.get_node_names(), "the node's end")


def test_a_start_by_itself_ends_active(graph):
    graph.add(Reader, {})
    assert graph.state_of("reader") == "active"
    assert graph.publisher(String, "words")


def test_parameters_are_locked_while_they_are_in_use(graph):
    node = graph.add(Reader, WAITING)
    assert graph.set_parameter("reader", "file", "other").successful
    wanted = RclpyParameter.Type.STRING  # Kilted names its number
    reason = graph.set_parameter("reader", "file", 3).reason
    assert f"expected '{wanted}'" in reason or f"expected '{wanted.value}'" in reason
    assert "read-only" in graph.set_parameter("reader", "depth", 3).reason
    assert graph.change_state("reader", "configure")
    assert node.loaded == "other"
    for transition in ("activate", "deactivate"):
        refused = graph.set_parameter("reader", "file", "good")
        assert not refused.successful
        assert "parameter 'file' is read when the node is configured" in refused.reason
        assert graph.set_parameter("reader", "speed", 2.0).successful
        assert graph.change_state("reader", transition)
    assert graph.change_state("reader", "cleanup")
    assert graph.set_parameter("reader", "file", "good").successful


@pytest.mark.parametrize("by_itself", [True, False])
def test_diagnostics_say_what_is_loading_for_as_long_as_it_takes(graph, by_itself):
    heard = []

    def load():
        """Takes until somebody else, whom the node does not hold up, has heard of it twice."""
        bystander, executor, deadline = Node("bystander"), SingleThreadedExecutor(), time.monotonic() + 60.0
        bystander.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 100)
        executor.add_node(bystander)
        while [array.status[0].message for array in heard].count("loading good") < 2:
            assert time.monotonic() < deadline
            executor.spin_once(timeout_sec=0.05)
        executor.shutdown()
        bystander.destroy_node()

    node = graph.add(lambda **options: Reader(load, **options), {"autostart": by_itself})
    assert by_itself or graph.change_state("reader", "configure")
    assert node.loaded == "good"


class Cycle:
    """Freed by the garbage collector only."""

    def __init__(self):
        self.me = self


def test_nothing_that_was_loaded_outlives_the_node(graph):
    loaded = []
    node = graph.add(lambda **options: Reader(lambda: loaded.append(Cycle()), **options), {})
    alive = weakref.ref(loaded[0])
    graph.remove(node)
    loaded.clear()
    gc.collect()
    assert alive() is None
