"""Messages are read in a thread of its own, each as soon as it is there."""

from __future__ import annotations

import queue
import threading

import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header, String

from midastouch_common.ros import qos, topic_reader
from midastouch_common.ros.topic_reader import TopicReader

pytestmark = pytest.mark.dds
PATIENCE_S = 30.0


@pytest.fixture
def read(graph, monkeypatch):
    """What a reader takes from the topic `read`, and the publisher; it never looks by itself."""
    monkeypatch.setattr(topic_reader, "LOOK_UP_NS", int(100e9))
    node, taken = graph.companion, queue.Queue()
    reader = TopicReader(node)
    reader.subscribe(Header, "read", taken.put, qos.TF_SUBSCRIBER)
    publisher = node.create_publisher(Header, "read", qos.TF)
    graph.spin_until(lambda: publisher.get_subscription_count() > 0)
    reader.start()
    yield taken, publisher
    reader.close()


def test_no_message_waits_for_the_next_while_the_executor_is_busy(graph, read):
    taken, publisher = read
    node = graph.companion
    node.create_subscription(String, "busy", lambda message: None, 10)
    other = node.create_publisher(String, "busy", 10)
    missed = []

    def one_after_the_other() -> None:
        for number in range(1500):
            publisher.publish(Header(frame_id=str(number)))
            other.publish(String())
            try:
                taken.get(timeout=PATIENCE_S)
            except queue.Empty:
                missed.append(number)
                return

    sender = threading.Thread(target=one_after_the_other)
    sender.start()
    while sender.is_alive():
        graph.spin_for(0.02)
    assert missed == []


def test_a_publisher_that_cannot_be_heard_is_reported(graph, read, capfd):
    unreliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    graph.companion.create_publisher(Header, "read", unreliable)
    said = []
    graph.spin_until(lambda: said.append(capfd.readouterr().err) or "incompatible QoS" in "".join(said))
