"""A replay under test, what it is told, and a consumer that answers it."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_msgs.msg import FilterStatus
from midastouch_tools.nodes.replay import Replay


def replay(graph, source, **parameters):
    return graph.add(Replay, {"source": str(source), "rate": 0.0, **parameters})


def paced(graph, source, **parameters):
    """A replay that waits for the answers of a filter."""
    return replay(graph, source, ack_topic="filter_status", wait_for_subscribers=1, **parameters)


def play(graph, node):
    node.start()
    graph.spin_until(node.finished.is_set, "the end of the replay")


def frames(node):
    """Numbers of frames sent, repeated and lost."""
    return node.player.frames_sent, node.player.frames_repeated, node.player.frames_lost


def stamps(messages):
    return [stamp_ns(message.header.stamp) for message in messages]


def answers(sent, statuses):
    """The statuses that answer each image of the stamps `sent` [ns], in their order."""
    said = {stamp: [] for stamp in sent}
    for status in statuses:
        if (stamp := stamp_ns(status.header.stamp)) in said and status.state != FilterStatus.STATE_WAITING:
            said[stamp].append(status)
    return list(said.values())


class Consumer:
    """Answers images with filter states, as slowly and as badly as a test wants."""

    def __init__(self, graph, answers):
        self.graph, self.received = graph, []
        self._answers = answers  # of the n-th image received: whether it is answered
        self.node = graph.companion
        self.statuses = self.node.create_publisher(FilterStatus, "filter_status", qos.latched(10))
        self.listen()
        self._health = self.node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def listen(self) -> None:
        """Subscribe the images."""
        self.images = self.node.create_subscription(Image, "image_raw", self._on_image, qos.stream_subscriber())

    def _on_image(self, image):
        self.received.append(stamp_ns(image.header.stamp))
        if self._answers(len(self.received)):
            self.answer(self.received[-1])

    def answer(self, stamp: int, state: str = "ambiguous") -> None:
        """Publish a state of the image of `stamp` [ns]."""
        self.statuses.publish(FilterStatus(header=Header(stamp=stamp_from_ns(stamp)), state=state))

    def report(self, *keys: str) -> None:
        """Report a health in which there are values of these names."""
        values = [KeyValue(key=key, value="x") for key in keys]
        status = DiagnosticStatus(name=f"companion: {self.node.get_fully_qualified_name()}", values=values)
        self._health.publish(DiagnosticArray(status=[status]))

    def report_regularly(self) -> None:
        """Report a health at work, faster than a filter does."""
        self.node.create_timer(0.02, lambda: self.report("state"))


def begun(graph, source, answers, **parameters):
    """A consumer whose filter reports its health and gives `answers`, and a replay that waits for it, at work."""
    consumer = Consumer(graph, answers)
    consumer.report_regularly()
    node = paced(graph, source, **parameters)
    graph.listen(TFMessage, "/tf")
    node.start()
    return consumer, node
