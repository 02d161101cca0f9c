"""The driver's node on the fake machine, and what listens to it."""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Callable

import pytest
from fake_kernel import FakeDigit

from digit_driver.nodes.digit_driver import DigitDriver
from digit_driver.v4l2_device import V4l2Camera

NAMESPACE = "/digit_test"


class Peer:
    """A driver in a namespace, and the messages `received` of its topics."""

    def __init__(self, graph, make_camera: Callable, **parameters) -> None:
        self.graph, self.received = graph, {}
        self.driver = graph.add(lambda **options: DigitDriver(make_camera, **options), parameters, namespace=NAMESPACE)

    def subscribe(self, kind: type, topic: str, qos=10):
        inbox = self.received.setdefault(topic, [])
        return self.graph.companion.create_subscription(kind, self._absolute(topic), inbox.append, qos)

    @staticmethod
    def _absolute(topic: str) -> str:
        return topic if topic.startswith("/") else f"{NAMESPACE}/{topic}"

    def wait(self, topic: str, predicate: Callable[[list], object] = bool) -> list:
        """The messages of a topic, once ``predicate`` holds for them."""
        inbox = self.received[topic]
        self.graph.spin_until(lambda: predicate(inbox), f"{topic} as awaited")
        return list(inbox)

    def call(self, kind: type, name: str, request):
        return self.graph.call(kind, self._absolute(name), request)

    def set_parameter(self, name: str, value):
        return self.graph.set_parameter(f"{NAMESPACE}/digit_driver", name, value)


@pytest.fixture
def peer(graph, kernel, find):
    """Starts drivers on the fake machine, with the given parameters."""
    return functools.partial(Peer, graph, functools.partial(V4l2Camera, system=kernel, find=find))


@pytest.fixture
def camera(kernel) -> FakeDigit:
    """A sensor plugged into the fake machine."""
    return kernel.plug(FakeDigit("D20001"))


@pytest.fixture
def run_driver():
    """Starts the driver's executable with the given ROS arguments."""

    def start(*arguments: str) -> subprocess.Popen:
        command = [sys.executable, "-m", "digit_driver.nodes.digit_driver", "--ros-args", *arguments]
        return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    return start
