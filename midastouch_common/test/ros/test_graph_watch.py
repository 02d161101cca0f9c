"""Waiting for lifecycle nodes to be active."""

from __future__ import annotations

import pytest

from midastouch_common.ros import diagnostics
from midastouch_common.ros.graph_watch import LifecycleWatch
from midastouch_common.ros.managed_node import AUTOSTART, ManagedNode

pytestmark = pytest.mark.dds


class Idle(ManagedNode):
    def __init__(self, name, **options):
        super().__init__(name, (AUTOSTART,), **options)
        self.autostart()

    def configure(self): ...

    def connect(self): ...

    def unload(self): ...

    def describe(self):
        return diagnostics.OK, "idles", {}


def add(graph, name, **parameters):
    return graph.add(lambda **options: Idle(name, **options), parameters)


def test_nodes_are_followed_from_before_their_start_to_their_end(graph):
    watch = LifecycleWatch(graph.companion, ["one", "/two"])
    assert watch.waiting_for == "one (not found), /two (not found)"
    one = add(graph, "one", autostart=False)
    graph.spin_until(lambda: watch.states["one"] == "unconfigured", "the state of the first")
    add(graph, "two")
    graph.spin_until(lambda: watch.waiting_for == "one (unconfigured)", "the second")

    assert graph.change_state("one", "configure")
    graph.spin_until(lambda: watch.waiting_for == "one (inactive)", "the event")
    assert graph.change_state("one", "activate")
    graph.spin_until(lambda: watch.waiting_for == "", "both")
    assert watch.states == {"one": "active", "/two": "active"}
    assert graph.change_state("one", "deactivate")
    graph.spin_until(lambda: watch.waiting_for == "one (inactive)", "the event")
    graph.remove(one)
    graph.spin_until(lambda: watch.waiting_for == "one (not found)", "its end")
    add(graph, "one")
    graph.spin_until(lambda: watch.waiting_for == "", "its successor")


def test_who_comes_late_learns_of_those_that_are_active(graph):
    add(graph, "one")
    watch = LifecycleWatch(graph.companion, ["one"])
    graph.spin_until(lambda: watch.waiting_for == "", "the answer")


def test_nobody_to_wait_for_is_nobody_waited_for(graph):
    assert LifecycleWatch(graph.companion, []).waiting_for == ""
