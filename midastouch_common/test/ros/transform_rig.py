"""A source of transforms that listens on a graph, and what it is sent."""

from __future__ import annotations

import time

from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg, translation

from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.queue import Wait
from midastouch_common.transforms.rigid import TransformError

FRAMES = "base_link", "digit_gel_frame"


def stamped(stamp: int, x: float, parent: str = "base_link", child: str = "digit_gel_frame"):
    return tf_msg(stamp, translation(x), parent, child).transforms[0]


class Listening:
    """A source on the graph, with what it reported."""

    def __init__(self, graph):
        self.graph, self.updates, self.jumps, self.bad, self.marks = graph, 0, [], [], 0
        self.source = TransformSource(graph.companion, FRAMES, self._update, self.jumps.append, self.bad.append)
        self.tf = graph.publisher(TFMessage, "/tf")

    def _update(self):
        self.updates += 1

    def lookup(self, stamp):
        return self.source.lookup(*FRAMES, stamp)

    def send(self, *transforms) -> None:
        """Publish, and wait until all is read: a mark, which nobody looks up, follows."""
        self.marks += 1
        self.tf.publish(TFMessage(transforms=[*transforms, stamped(self.marks, self.marks, "mark", "mark_below")]))
        self.graph.spin_until(self._marked, "the transforms to be read")

    def _marked(self) -> bool:
        try:
            return self.source.newest("mark", "mark_below")[0, 3] == self.marks
        except TransformError:
            return False

    def wait_unspun(self, done) -> None:
        """Wait until that, while nothing spins."""
        deadline = time.monotonic() + 60
        while not done():
            assert time.monotonic() < deadline
            time.sleep(0.01)

    def until(self, stamp):
        """The pose at a stamp, once it is told that it is there."""
        found = self.lookup(stamp)
        while isinstance(found, Wait):
            updates = self.updates
            self.graph.spin_until(lambda updates=updates: self.updates > updates, "the transform")
            found = self.lookup(stamp)
        return found
