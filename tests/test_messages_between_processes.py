"""Every message, service and action that the set-up builds goes over DDS to another process and back.

The set-up builds the type supports that nodes in Python load, and no others (tools/ros_wheels/python_only.cmake).
As a module it is the other process.
"""

import importlib
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
import rclpy
from ament_index_python.packages import get_package_share_directory
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

PACKAGES = ("tf2_msgs", "vision_msgs", "midastouch_msgs")
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # whoever comes later gets it, too
TIMEOUT_S, ANSWER_S = 120, 10

pytestmark = pytest.mark.dds


def interfaces(kind: str) -> dict[str, type]:
    """By their names, those of a kind: msg, srv, action."""
    found = {}
    for package in PACKAGES:
        for path in sorted(Path(get_package_share_directory(package), kind).glob(f"*.{kind}")):
            module = importlib.import_module(f"{package}.{kind}")
            found[f"{package}_{kind}_{path.stem}"] = getattr(module, path.stem)
    return found


def filled(message: object) -> object:
    """The message, no field of which that is a number, a word or another message is at its default."""
    values = {"boolean": True, "double": 0.5, "float": 0.5, "string": "word"}
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            filled(value)
        elif kind in values or kind.startswith(("int", "uint")):
            setattr(message, name, values.get(kind, 7))
    return message


def answer() -> None:
    """Send every message back, answer every request, reach every goal, until the process is killed."""
    rclpy.init()
    node = Node("other_process")
    for name, message in interfaces("msg").items():
        back = node.create_publisher(message, f"{name}_back", KEPT)
        node.create_subscription(message, name, back.publish, KEPT)
    for name, service in interfaces("srv").items():
        node.create_service(service, name, lambda _, response: filled(response))
    for name, action in interfaces("action").items():

        def reach(goal, action=action):
            goal.publish_feedback(filled(action.Feedback()))
            goal.succeed()
            return filled(action.Result())

        node.action_server = ActionServer(node, action, name, reach)
    rclpy.spin(node)


def test_every_interface_goes_to_another_process_and_back():
    assert [len(interfaces(kind)) for kind in ("msg", "srv", "action")] == [13, 3, 5]
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node("this_process", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    other = subprocess.Popen([sys.executable, __file__])

    def outcome(ask):
        """Of the future that `ask` returns; asked again, as a client is ready before the server knows it."""
        until = time.monotonic() + TIMEOUT_S
        while time.monotonic() < until:
            executor.spin_until_future_complete(future := ask(), timeout_sec=ANSWER_S)
            if future.done():
                return future.result()
        raise TimeoutError("no answer")

    def reached(name, action):
        """Feedback of a goal that was reached; sent again where its feedback was lost."""
        client, heard = ActionClient(node, action, name), rclpy.Future(executor=executor)
        assert client.wait_for_server(TIMEOUT_S)

        def send():
            return client.send_goal_async(filled(action.Goal()), lambda said: heard.done() or heard.set_result(said))

        def result():
            assert outcome(outcome(send).get_result_async).result == filled(action.Result()), name
            return heard

        feedback = outcome(result)
        client.destroy()
        return feedback

    try:
        for name, message in interfaces("msg").items():
            came = rclpy.Future(executor=executor)
            back = node.create_subscription(message, f"{name}_back", came.set_result, KEPT)
            there = node.create_publisher(message, name, KEPT)
            there.publish(filled(message()))
            assert outcome(lambda came=came: came) == filled(message()), name
            node.destroy_subscription(back)
            node.destroy_publisher(there)
        for name, service in interfaces("srv").items():
            client = node.create_client(service, name)
            assert client.wait_for_service(TIMEOUT_S)
            ask = partial(client.call_async, filled(service.Request()))
            assert outcome(ask) == filled(service.Response()), name
        for name, action in interfaces("action").items():
            assert reached(name, action).feedback == filled(action.Feedback()), name
    finally:
        other.kill()
        other.wait()
        executor.shutdown()
        node.destroy_node()
        context.shutdown()


if __name__ == "__main__":
    answer()
