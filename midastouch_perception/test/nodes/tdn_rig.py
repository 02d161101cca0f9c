"""The node `tdn`, and images for it."""

from __future__ import annotations

import numpy as np
from perception_fakes import FakeDepthStage, image_msg
from sensor_msgs.msg import Image

from midastouch_msgs.msg import TactileContact
from midastouch_perception.nodes.tdn import TdnNode

REPLAY = {"queue_depth": 100, "reliable": True}


def start(graph, depth: FakeDepthStage | None = None, **parameters) -> TdnNode:
    """The node, ready for a replay without loss; without `depth` on the shipped network."""
    return graph.add(lambda **options: TdnNode(depth=depth, **options), {**REPLAY, **parameters})


class Feed:
    """Sends images to the node, stamped 1, 2, 3, ... ns, and hears its contacts."""

    def __init__(self, graph):
        self._graph, self._stamp = graph, 0
        self._images = graph.publisher(Image, "image_raw")
        self.contacts = graph.listen(TactileContact, "tactile/contact")

    def send(self, *frames: np.ndarray) -> None:
        for pixels in frames:
            self._stamp += 1
            self._images.publish(image_msg(pixels, self._stamp))

    def touches(self, pixels: np.ndarray) -> bool:
        """Whether the node finds a contact in an image, which it has answered when this returns."""
        before = len(self.contacts)
        self.send(pixels)
        self._graph.spin_until(lambda: len(self.contacts) > before, "the contact of an image")
        return self.contacts[-1].in_contact
