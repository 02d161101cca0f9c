"""The driver's node beside a node that listens to it, and what both are fed with."""

from __future__ import annotations

import functools
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest
import rclpy
from fake_kernel import FakeDigit
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from digit_driver.nodes.digit_driver import DigitDriver
from digit_driver.v4l2_device import V4l2Camera
from midastouch_common.errors import InputError

TIMEOUT_S = 120.0  # bounds a failing test only


class Peer:
    """A driver and a node that listens to it, both spinning in a thread of their own."""

    def __init__(self, make_camera: Callable, **parameters) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.received: dict[str, list] = {}
        self._changed = threading.Condition()
        try:
            overrides = [Parameter(name, value=value) for name, value in parameters.items()]
            self.driver = DigitDriver(
                make_camera, context=self.context, namespace="/digit_test", parameter_overrides=overrides
            )
        except InputError:
            self.context.shutdown()
            raise
        self.node = rclpy.create_node("peer", namespace="/digit_test", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.driver)
        self._executor.add_node(self.node)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        while not self._stopping.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self._stopping.set()
        self._thread.join()
        self.driver.destroy_node()
        self.node.destroy_node()
        self._executor.shutdown()
        self.context.shutdown()

    def subscribe(self, kind: type, topic: str, qos=10):
        inbox = self.received.setdefault(topic, [])

        def store(message) -> None:
            with self._changed:
                inbox.append(message)
                self._changed.notify_all()

        return self.node.create_subscription(kind, topic, store, qos)

    def wait(self, topic: str, predicate: Callable[[list], object] = bool):
        """The messages of a topic, once ``predicate`` holds for them."""
        with self._changed:
            inbox = self.received[topic]
            assert self._changed.wait_for(lambda: predicate(inbox), timeout=TIMEOUT_S), f"{topic}: {inbox[-1:]}"
            return list(inbox)

    def call(self, kind: type, name: str, request):
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(TIMEOUT_S)
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        assert answered.wait(TIMEOUT_S), name
        return future.result()

    def set_parameter(self, name: str, value):
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call(SetParameters, "digit_driver/set_parameters", request).results[0]


@pytest.fixture
def peer(kernel, find):
    """Starts drivers on the fake machine, with the given parameters, and ends them."""
    started = []

    def start(**parameters) -> Peer:
        started.append(Peer(functools.partial(V4l2Camera, system=kernel, find=find), **parameters))
        return started[-1]

    yield start
    for item in started:
        item.close()


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
